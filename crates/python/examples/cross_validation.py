"""Cross-validation over recordings by scikit-learn: what a sensor is worth on a recording that its calibration has not seen.

    pip install 'ohmstrain[sklearn]'
    python cross_validation.py monday.csv tuesday.csv wednesday.csv

Each recording is left out once (LeaveOneGroupOut), the sensor is calibrated on the others, and smooths it. Rows are never shuffled.
"""

import sys

import numpy as np
import ohmstrain as oh
from ohmstrain.sklearn import StrainRegressor
from sklearn.model_selection import LeaveOneGroupOut, cross_validate


def main(*files):
    recordings = [oh.read(file) for file in files]
    rows = [np.column_stack([table["time_s"], table["resistance_ohm"]]) for table in recordings]
    strain = np.concatenate([table["strain"].to_numpy() for table in recordings])
    groups = np.repeat(np.arange(len(files)), [len(part) for part in rows])
    scored = cross_validate(
        StrainRegressor(estimator="ekf"),  # Quick; leave it out for the default, which learns what the law gets wrong.
        np.vstack(rows),
        strain,
        groups=groups,
        cv=LeaveOneGroupOut(),
        scoring=("neg_root_mean_squared_error", "r2"),
    )
    for file, rmse, r2 in zip(files, -scored["test_neg_root_mean_squared_error"], scored["test_r2"]):
        print(f"{file} left out: RMSE {100 * rmse / np.ptp(strain):.2f} %FS, R2 {r2:.3f}")


if __name__ == "__main__":
    main(*sys.argv[1:])
