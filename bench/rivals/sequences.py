"""Methods with a state of their own: an echo state network, a GRU and an LSTM."""

import keras
import numpy as np
from regressions import chosen
from sklearn.linear_model import Ridge

from recordings import folds

SEEDS = 3
# Of the recordings that are learned from: as many steps in half of one.
STEPS = 600
WINDOW = 160
UPDATES = 250
BATCH = 8


def stride(parts):
    """Rows between steps of a net, so that each part has about `STEPS` of them."""
    rows = np.median([part.learns.sum() for part in parts])
    return max(1, round(rows / STEPS))


def inputs_of(recording, stride):
    """The ratio and its differences over a quarter, a half and a whole step."""
    step_s = stride * recording.step_s
    ago = [np.interp(recording.time_s - share * step_s, recording.time_s, recording.ratio) for share in (0.25, 0.5, 1)]
    return np.column_stack([recording.ratio, *(recording.ratio - past for past in ago)])


class Scaled:
    """Inputs and truth with mean 0 and standard deviation 1 over the rows that are learned from."""

    def __init__(self, parts, stride):
        self.stride = stride
        inputs = np.concatenate([inputs_of(part.recording, stride)[part.learns] for part in parts])
        truth = np.concatenate([part.recording.truth[part.learns] for part in parts])
        self.mean, self.deviation = inputs.mean(0), inputs.std(0) + 1e-9
        self.truth_mean, self.truth_deviation = truth.mean(), truth.std()

    def inputs(self, recording):
        return ((inputs_of(recording, self.stride) - self.mean) / self.deviation).astype(np.float32)

    def truth(self, recording):
        return ((recording.truth - self.truth_mean) / self.truth_deviation).astype(np.float32)

    def sequences(self, rows):
        """Rows `stride` apart as sequences of one length, the last row repeated."""
        length = -(-len(rows) // self.stride)
        padded = np.concatenate([rows, np.repeat(rows[-1:], length * self.stride - len(rows), axis=0)])
        return padded.reshape(length, self.stride, *rows.shape[1:]).swapaxes(0, 1)

    def rows(self, sequences, count):
        return sequences.swapaxes(0, 1).reshape(-1)[:count] * self.truth_deviation + self.truth_mean


class Sequence:
    """Several models, averaged. Each is judged without another recording or quarter, and then learns from all."""

    def fit_with_deviation(self, parts):
        """Fits, and returns the root mean square error on what was left out."""
        self.scaled = Scaled(parts, stride(parts))
        self.models, errors = [], []
        for seed, (learned, left) in enumerate(folds(parts)[:SEEDS]):
            model, effort = self.judged(learned, left, seed)
            errors.append((self.run(model, left.recording) - left.recording.truth)[left.learns])
            self.models.append(self.fitted(parts, seed, effort))
        return float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))

    def predict(self, recording):
        return np.mean([self.run(model, recording) for model in self.models], axis=0)


class Recurrent(Sequence):
    """A recurrent layer of 32 units, one of 32 tanh units, and a straight line from the inputs."""

    def __init__(self, cell):
        self.cell = cell

    def net(self):
        inputs = keras.Input((None, 4))
        state = self.cell(32, return_sequences=True)(inputs)
        hidden = keras.layers.Dense(32, "tanh")(keras.layers.Concatenate()([state, inputs]))
        output = keras.layers.Add()([keras.layers.Dense(1)(hidden), keras.layers.Dense(1)(inputs)])
        net = keras.Model(inputs, output)
        rate = keras.optimizers.schedules.CosineDecay(6e-3, UPDATES, alpha=2e-3)
        net.compile(keras.optimizers.AdamW(rate, weight_decay=1e-3, global_clipnorm=1.0), "mse")
        return net

    def judged(self, learned, left, seed):
        """The net that is best on what is left out, and how many updates it took."""
        error = lambda net: np.mean((self.run(net, left.recording) - left.recording.truth)[left.learns] ** 2)
        best = (np.inf, None, 0)
        for net, update in self.updates(learned, seed, UPDATES):
            if update % 25 == 0 and (found := error(net)) < best[0]:
                best = (found, net.get_weights(), update)
        net.set_weights(best[1])
        return net, best[2]

    def fitted(self, parts, seed, updates):
        for net, _ in self.updates(parts, seed, updates):
            pass
        return net

    def updates(self, parts, seed, count):
        """A net after each of its updates."""
        keras.utils.set_random_seed(seed)
        random = np.random.default_rng(seed)
        net = self.net()
        sequences = [self.targets(part) for part in parts]
        for update in range(1, count + 1):
            batch = [self.window(sequences[random.integers(len(sequences))], random) for _ in range(BATCH)]
            inputs, truth, counts = (np.stack(columns) for columns in zip(*batch))
            inputs = inputs + 0.02 * random.standard_normal(inputs.shape).astype(np.float32)
            net.train_on_batch(inputs, truth[..., None], counts)
            yield net, update

    def targets(self, part):
        scaled = self.scaled
        columns = scaled.inputs(part.recording), scaled.truth(part.recording), part.learns.astype(np.float32)
        return [scaled.sequences(column) for column in columns]

    @staticmethod
    def window(sequences, random):
        """A window of one sequence: inputs, truth, and which rows count. Where a recording has begun before the window, a state
        that knows nothing of that does not count; a shorter one is filled up with rows that do not."""
        which, length = random.integers(len(sequences[0])), len(sequences[0][0])
        start = max(0, random.integers(-WINDOW // 3, max(1, length - WINDOW + 1)))
        cut = [column[which, start : start + WINDOW].copy() for column in sequences]
        if start > 0:
            cut[2][: WINDOW // 5] = 0
        missing = WINDOW - len(cut[0])
        return [np.concatenate([column, np.zeros((missing, *column.shape[1:]), column.dtype)]) for column in cut]

    def run(self, net, recording):
        sequences = self.scaled.sequences(self.scaled.inputs(recording))
        return self.scaled.rows(net.predict_on_batch(sequences)[..., 0], len(recording.truth))


class EchoState(Sequence):
    """A reservoir of 200 leaky units of spectral radius 0.95, read out by ridge regression."""

    units, leak = 200, 0.3

    def states(self, seed, recording):
        random = np.random.default_rng(seed)
        recurrent = random.standard_normal((self.units, self.units)) * (random.random((self.units, self.units)) < 0.1)
        recurrent *= 0.95 / np.abs(np.linalg.eigvals(recurrent)).max()
        feed = random.uniform(-0.5, 0.5, (4, self.units))
        offset = random.uniform(-0.5, 0.5, self.units)
        sequences = self.scaled.sequences(self.scaled.inputs(recording))
        state, states = np.zeros((len(sequences), self.units)), []
        for inputs in sequences.swapaxes(0, 1):
            state = (1 - self.leak) * state + self.leak * np.tanh(inputs @ feed + state @ recurrent + offset)
            states.append(np.concatenate([state, inputs], axis=1))
        return np.stack(states, axis=1)

    def judged(self, learned, left, seed):
        return self.fitted(learned, seed), None

    def fitted(self, parts, seed, effort=None):
        rows, truth = [], []
        for part in parts:
            counts = self.scaled.sequences(part.learns)
            rows.append(self.states(seed, part.recording)[counts])
            truth.append(self.scaled.sequences(self.scaled.truth(part.recording))[counts])
        readout = chosen(Ridge(), {"alpha": np.logspace(-4, 4, 9)})
        return seed, readout.fit(np.concatenate(rows), np.concatenate(truth))

    def run(self, model, recording):
        seed, readout = model
        states = self.states(seed, recording)
        predicted = readout.predict(states.reshape(-1, states.shape[-1])).reshape(states.shape[:2])
        return self.scaled.rows(predicted, len(recording.truth))
