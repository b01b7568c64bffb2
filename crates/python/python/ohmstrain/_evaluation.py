"""Scores of estimates against a known strain."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from . import Sensor


@dataclass(frozen=True)
class Scores:
    """Scores of one estimate; the names are those of ``ohmstrain evaluate --json``."""

    n: int
    rmse: float
    mae: float
    bias: float
    rmse_percent_fs: float
    coverage_50: float | None
    coverage_90: float | None
    coverage_95: float | None
    width_95_percent_fs: float | None
    crps_percent_fs: float
    log_score: float | None
    wrong_branch: float

    @classmethod
    def of_json(cls, text: str) -> Scores:
        """Parse the scores that the library returns."""
        known = json.loads(text)
        return cls(**{name: known.get(name) for name in cls.__dataclass_fields__})


class Evaluation:
    """Scores by the name of the estimate: ``filter``, ``smoother``, ``static_cubic``, and further baselines after a split."""

    def __init__(self, scored: Iterable[tuple[str, str]], name: str | None, split: float | None) -> None:
        self.scores = {of: Scores.of_json(text) for of, text in scored}
        self.name = name
        self.split = split
        #: The sensor calibrated for a split.
        self.sensor: Sensor | None = None

    def __getitem__(self, of: str) -> Scores:
        return self.scores[of]

    def __getattr__(self, of: str) -> Scores:
        try:
            return self.__dict__["scores"][of]
        except KeyError:
            raise AttributeError(of) from None

    def __iter__(self) -> Iterator[str]:
        return iter(self.scores)

    def __repr__(self) -> str:
        head = f"{'estimate':16}{'%FS':>8}{'RMSE':>10}{'bias':>10}  50/90/95 %"
        lines = [head]
        for of, scores in self.scores.items():
            covered = [scores.coverage_50, scores.coverage_90, scores.coverage_95]
            shares = "/".join(f"{100 * share:.0f}" for share in covered if share is not None)
            lines.append(
                f"{of:16}{scores.rmse_percent_fs:8.2f}{scores.rmse:10.4f}{scores.bias:+10.4f}  {shares}".rstrip()
            )
        return "\n".join(lines)
