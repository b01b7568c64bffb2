"""Methods that learn one row at a time."""

import warnings

import features
import lightgbm
import numpy as np
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, WhiteKernel
from sklearn.linear_model import LinearRegression, Ridge
from sklearn.model_selection import GridSearchCV, KFold
from sklearn.neural_network import MLPRegressor
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import PolynomialFeatures, StandardScaler

from recordings import folds

SEEDS = 3


class Regression:
    """A regression of the truth on features of the ratio; several seeds are averaged."""

    def __init__(self, described, made, seeds=1, rows=None):
        self.described, self.made, self.seeds, self.rows = described, made, seeds, rows

    def fit(self, parts):
        inputs = np.concatenate([self.described(part.recording)[part.learns] for part in parts])
        truth = np.concatenate([part.recording.truth[part.learns] for part in parts])
        if self.rows and len(truth) > self.rows:
            kept = np.linspace(0, len(truth) - 1, self.rows).round().astype(int)
            inputs, truth = inputs[kept], truth[kept]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ConvergenceWarning)
            self.models = [self.made(seed).fit(inputs, truth) for seed in range(self.seeds)]
        return self

    def predict(self, recording):
        inputs = self.described(recording)
        return np.mean([model.predict(inputs) for model in self.models], axis=0)

    def fit_with_deviation(self, parts):
        """Fits, and returns the root mean square error on what was left out."""
        errors = []
        for learned, left in folds(parts):
            predicted = self.fit(learned).predict(left.recording)
            errors.append((predicted - left.recording.truth)[left.learns])
        self.fit(parts)
        return float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))


def chosen(model, choices):
    """The choice that predicts quarters best which are left out: rows beside each other are too alike to be left out alone."""
    return GridSearchCV(model, choices, cv=KFold(4), scoring="neg_mean_squared_error")


def cubic(seed):
    return make_pipeline(StandardScaler(), PolynomialFeatures(3), LinearRegression())


def products(seed):
    model = make_pipeline(StandardScaler(), PolynomialFeatures(2), StandardScaler(), Ridge())
    return chosen(model, {"ridge__alpha": np.logspace(-2, 6, 9)})


def boosted(seed):
    return lightgbm.LGBMRegressor(
        n_estimators=300, learning_rate=0.05, num_leaves=15, random_state=seed, n_jobs=1, verbose=-1
    )


def process(seed):
    model = make_pipeline(StandardScaler(), GaussianProcessRegressor(optimizer=None, normalize_y=True))
    kernels = [RBF(length) + WhiteKernel(noise) for length in (1, 2, 4, 8) for noise in (1e-3, 1e-2, 1e-1)]
    return chosen(model, {"gaussianprocessregressor__kernel": kernels})


def small_net(seed):
    net = MLPRegressor(hidden_layer_sizes=(16,), activation="tanh", solver="lbfgs", alpha=1.0, max_iter=500, random_state=seed)
    return make_pipeline(StandardScaler(), net)
