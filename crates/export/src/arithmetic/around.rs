//! Functions in C around a filter: treatment of a reading, doubts, features of readings for the correction. The library's own
//! code runs on expressions, once for every path through it.

use ohmstrain_ekf::correction::{Decay, FeatureScale, ReadingFeatures, TIME_CONSTANTS_S};
use ohmstrain_ekf::live::{
    Doubts, FaultWatch, Flag, Jumps, LiveParts, Repeats, RestFollower, SURPRISING_NIS, Sieve, StaticCurve, reported,
};
use ohmstrain_ekf::record::{Expression, Fields, See, Writer};
use ohmstrain_ekf::{Gaussian, Influence, Reading, ReadingVerdict};
use ohmstrain_model::Number;

use super::correction;
use super::function::{Kept, Printed, RETURNED};
use super::listed::Lists;
use crate::twin::{OwnedLearned, Parts};

const LOW_PASSES: usize = TIME_CONSTANTS_S.len();

/// Functions around the filter of a sensor.
pub struct Around<'a> {
    pub parts: &'a Parts<'a>,
}

impl Around<'_> {
    /// Returns all functions, each also as a list if there are lists.
    pub fn text(&self, lists: Option<&mut Lists>) -> String {
        let of_readings = [Self::pass_time(), self.sieve(), startles(), self.coarser(), weighted(), self.reported()];
        let of_rest = [self.on_followed_rest(), self.of_session(), self.follow(), self.is_within()];
        let of_doubts =
            [self.begin(), self.tell_rest(), self.run(), self.doubt_reading(), self.doubt_pause(), self.doubted()];
        let mut all: Vec<_> =
            of_readings.into_iter().chain(of_rest).chain(of_doubts).chain([self.has_begun(), self.refuse()]).collect();
        if self.parts.live.doubt.turns.is_some() {
            all.push(self.watch_turns());
        }
        if let Some(curve) = &self.parts.curve {
            all.extend([may_be_spike(), on_curve(curve)]);
        }
        if let Some(correction) = self.parts.correction {
            all.extend([self.birge(), watch(&correction.features)]);
            all.extend(correction::functions(&OwnedLearned::new(
                correction,
                self.parts.quadratics,
                self.parts.limits_in::<f32>(),
            )));
        }
        let text: Vec<String> = match lists {
            None => all.iter().map(Printed::text).collect(),
            Some(lists) => {
                let Declared { kept, .. } = self.declared();
                all.iter().map(|printed| printed.either(&kept, lists)).collect()
            }
        };
        text.join("\n")
    }

    /// Returns their state from step to step, as fields of a struct.
    pub fn fields(&self) -> Vec<String> {
        let Declared { numbers, truths, .. } = self.declared();
        numbers.into_iter().chain(truths).collect()
    }

    fn declared(&self) -> Declared {
        let mut fields = Declared::default();
        Repeats::<Expression<'_>>::none().each(&mut fields);
        Jumps::<Expression<'_>>::none().each(&mut fields);
        FaultWatch::<Expression<'_>>::new().each(&mut fields);
        self.follower().each(&mut fields);
        self.doubts().each(&mut fields);
        if let Some(correction) = self.parts.correction {
            ReadingFeatures::<Expression<'_>>::new(correction.features.to()).each(&mut fields);
        }
        fields
    }

    fn live<'t>(&self) -> LiveParts<Expression<'t>, ()> {
        self.parts.live.to()
    }

    fn doubts<'t>(&self) -> Doubts<Expression<'t>> {
        let doubts = Doubts::new(self.live().doubt);
        if self.parts.correction.is_some() { doubts.of_corrected() } else { doubts }
    }

    fn follower<'t>(&self) -> RestFollower<Expression<'t>> {
        RestFollower::new(self.live().rest)
    }
}

impl Around<'_> {
    fn pass_time() -> Printed {
        Printed::new("pass_time", "Time has passed.", &["float dt_s"], |writer| {
            let mut repeats = writer.state(Repeats::none());
            repeats.pass(writer.input("dt_s"));
            writer.keep(repeats);
        })
    }

    fn sieve(&self) -> Printed {
        Printed::new(
            "sieve",
            "Verdict on a relative reading: a flag, or 0 if it is to be used, with the extra variance due to repetition and correlated errors.",
            &["float lower", "float upper", "float longest_repeat_s", "float rho", "float extra_variance"],
            |writer| {
                let mut repeats = writer.state(Repeats::none());
                let sieve = Sieve {
                    plausible: (writer.input("lower"), writer.input("upper")),
                    longest_repeat_s: writer.input("longest_repeat_s"),
                    ..self.live().sieve
                };
                let reading = of_reading(writer);
                let sieved = repeats.sieved(&sieve, reading, self.live().reading_variance);
                writer.keep(repeats);
                writer.give("sieved_variance", sieved.map_or(reading.extra_variance, |seen| seen.extra_variance));
                writer.tell("OHMSTRAIN_IMPLAUSIBLE", sieved.err() == Some(ReadingVerdict::Implausible));
                writer.tell("OHMSTRAIN_STUCK", sieved.err() == Some(ReadingVerdict::Stuck));
            },
        )
    }

    fn coarser(&self) -> Printed {
        Printed::new(
            "coarser",
            "Reading with more noise, for one too exact for single precision; false if more noise does not help.",
            &["float rho", "float extra_variance"],
            |writer| {
                let reading = of_reading(writer);
                let coarser = reading.coarser(self.live().reading_variance, number(f32::EPSILON));
                writer.give("more_variance", coarser.unwrap_or(reading).extra_variance);
                writer.tell(RETURNED, coarser.is_some());
            },
        )
    }

    fn reported(&self) -> Printed {
        Printed::new(
            "reported",
            "Reported strain of the filter, and its variance.",
            &["float mean", "float variance"],
            |writer| {
                let strain = Gaussian { mean: writer.input("mean"), variance: writer.input("variance") };
                let LiveParts { limits, strain_sd_scale, .. } = self.live();
                let reported = reported(strain, strain_sd_scale, &limits);
                writer.give("reported_variance", reported.variance);
                writer.give(RETURNED, reported.mean);
            },
        )
    }

    fn on_followed_rest(&self) -> Printed {
        Printed::new(
            "on_followed_rest",
            "Reading relative to the tracked R0, from one relative to that of the calibration.",
            &["float rho", "float extra_variance"],
            |writer| {
                let shown = writer.state(self.follower()).relative(of_reading(writer));
                writer.give("shown", shown.value);
                writer.give("shown_variance", shown.extra_variance);
            },
        )
    }

    fn of_session(&self) -> Printed {
        Printed::new(
            "of_session",
            "Reading relative to R0 at the start of the session, from one relative to that of the calibration.",
            &["float rho"],
            |writer| {
                let of_session = writer.state(self.follower()).of_session(writer.input("rho"));
                writer.give(RETURNED, of_session);
            },
        )
    }

    fn follow(&self) -> Printed {
        Printed::new(
            "follow",
            "Adapts R0 to a reading: slowly to one outside the calibrated range, and soon back to one beyond the other end.",
            &["float dt_s", "float rho"],
            |writer| {
                let mut follower = writer.state(self.follower());
                follower.see(writer.input("dt_s"), writer.input("rho"));
                writer.keep(follower);
            },
        )
    }

    fn is_within(&self) -> Printed {
        Printed::new(
            "is_within",
            "True for a reading within the calibrated range, relative to the tracked R0.",
            &["float rho"],
            |writer| {
                let is_within = writer.state(self.follower()).is_within(writer.input("rho"));
                writer.tell(RETURNED, is_within);
            },
        )
    }

    fn begin(&self) -> Printed {
        Printed::new(
            "begin",
            "Initial doubts, at a known strain, and at rest, if these are true.",
            &["int is_known", "int is_at_rest"],
            |writer| {
                let doubts = self.doubts();
                writer.keep(if writer.truth("is_known") {
                    doubts.of_known_strain(writer.truth("is_at_rest"))
                } else {
                    doubts
                });
            },
        )
    }

    fn tell_rest(&self) -> Printed {
        Printed::new("tell_rest", "R0 of today has been told.", &[], |writer| {
            let mut doubts = writer.state(self.doubts());
            doubts.restart_rest_watch();
            writer.keep(doubts);
        })
    }

    fn birge(&self) -> Printed {
        Printed::new(
            "birge_of",
            "Ratio of the recent innovation variance to the stated one, at least 1.",
            &[],
            |writer| {
                let birge = writer.state(self.doubts()).birge();
                writer.give(RETURNED, birge);
            },
        )
    }

    fn run(&self) -> Printed {
        Printed::new("run", "Time has passed since the step before, if there was one.", &["float dt_s"], |writer| {
            let mut doubts = writer.state(self.doubts());
            doubts.pass(writer.input("dt_s"));
            writer.keep(doubts);
        })
    }

    fn refuse(&self) -> Printed {
        Printed::new("refuse", "A reading has been refused.", &[], |writer| {
            let mut doubts = writer.state(self.doubts());
            doubts.refuse();
            writer.keep(doubts);
        })
    }

    fn has_begun(&self) -> Printed {
        Printed::new("has_begun", "True after a used reading, or a known strain.", &[], |writer| {
            let has_begun = writer.state(self.doubts()).has_begun();
            writer.tell(RETURNED, has_begun);
        })
    }

    fn watch_turns(&self) -> Printed {
        Printed::new("watch_turns", "Takes a reading that will be used.", &["float rho"], |writer| {
            let mut doubts = writer.state(self.doubts());
            doubts.watch_turns(writer.input("rho"));
            writer.keep(doubts);
        })
    }

    fn doubt_reading(&self) -> Printed {
        Printed::new(
            "doubt_reading",
            "Takes a used reading and its normalised innovation squared.",
            &["float rho", "float nis"],
            |writer| {
                let mut doubts = writer.state(self.doubts());
                doubts.read(writer.input("rho"), writer.input("nis"));
                writer.keep(doubts);
            },
        )
    }

    fn doubt_pause(&self) -> Printed {
        Printed::new(
            "doubt_pause",
            "Variance of the strain after the time since the last reading.",
            &["float strain", "float variance"],
            |writer| {
                let doubts = writer.state(self.doubts());
                let stated = Gaussian { mean: writer.input("strain"), variance: writer.input("variance") };
                writer.give(RETURNED, doubts.open(stated));
            },
        )
    }

    fn doubted(&self) -> Printed {
        Printed::new(
            "doubted",
            "Variance of the strain with all doubts, and their flags.",
            &["float strain", "float rate", "float variance"],
            |writer| {
                let doubts = writer.state(self.doubts());
                let stated = Gaussian { mean: writer.input("strain"), variance: writer.input("variance") };
                let (variance, flags) = doubts.widened(stated, writer.input("rate"));
                writer.give("widened", variance);
                for (name, flag) in DOUBTS {
                    writer.tell(name, flags.has(flag));
                }
            },
        )
    }
}

/// Flags of doubts, by their names in C.
const DOUBTS: [(&str, Flag); 5] = [
    ("OHMSTRAIN_START_UP", Flag::StartUp),
    ("OHMSTRAIN_RECOVERING", Flag::Recovering),
    ("OHMSTRAIN_EXTRAPOLATED", Flag::Extrapolated),
    ("OHMSTRAIN_LONG_RUN", Flag::LongRun),
    ("OHMSTRAIN_REST_MOVED", Flag::RestMoved),
];

fn weighted() -> Printed {
    Printed::new(
        "weighted",
        "Extra variance of an outlier, which gives it less weight.",
        &["float extra_variance", "float nis", "float variance"],
        |writer| {
            let weight =
                Influence::Redescending { threshold: number(SURPRISING_NIS.sqrt() as f32) }.weight(writer.input("nis"));
            let reading = Reading { value: number(0.0), extra_variance: writer.input("extra_variance") };
            writer.give(RETURNED, reading.weighted(weight, writer.input("variance")).extra_variance);
        },
    )
}

fn startles() -> Printed {
    Printed::new(
        "startles",
        "True if readings have jumped by more than `farthest`, and the jump.",
        &["float rho", "float nis", "float farthest"],
        |writer| {
            let mut jumps = writer.state(Jumps::none());
            let jump = jumps.see(writer.input("rho"), writer.input("nis"), writer.input("farthest"));
            writer.keep(jumps);
            writer.give("jump", jump.unwrap_or(number(0.0)));
            writer.tell(RETURNED, jump.is_some());
        },
    )
}

/// Records whether the last reading may be a spike.
fn may_be_spike() -> Printed {
    Printed::new("may_be_spike", "True for the first three startling readings in a row.", &[], |writer| {
        let jumps = writer.state(Jumps::none());
        writer.tell(RETURNED, jumps.may_be_spike());
    })
}

/// Records the strain of a reading on a curve.
fn on_curve(curve: &StaticCurve<f64>) -> Printed {
    Printed::new(
        "on_curve",
        "Strain of a relative reading by the static cubic, and its variance.",
        &["float rho"],
        |writer| {
            let Gaussian { mean, variance } = curve.to().strain(writer.input("rho"));
            writer.give("curve_variance", variance);
            writer.give(RETURNED, mean);
        },
    )
}

/// Records the features of the readings for the correction.
fn watch(scale: &FeatureScale<f64>) -> Printed {
    Printed::new(
        "watch",
        "Passes a relative reading to the low-passes, which forget these shares; without one they wait. The first few outliers are left out.",
        &[
            "float dt_s",
            "int is_read",
            "float rho",
            "int is_surprising",
            "const float decay[LOW_PASSES]",
            "const float mean_decay[LOW_PASSES]",
        ],
        |writer| {
            let mut features = writer.state(ReadingFeatures::new(scale.to()));
            let reading = writer.truth("is_read").then(|| writer.input("rho"));
            let reading = features.unless(writer.truth("is_surprising"), reading);
            let [ends, means]: [[_; LOW_PASSES]; 2] = ["decay", "mean_decay"].map(|name| writer.inputs(name));
            let decays = core::array::from_fn(|k| Decay { end: ends[k], mean: means[k] });
            features.step_with(writer.input("dt_s"), reading, |_| decays);
            writer.keep(features);
        },
    )
}

fn of_reading<'t>(writer: &Writer<'t>) -> Reading<Expression<'t>> {
    Reading { value: writer.input("rho"), extra_variance: writer.input("extra_variance") }
}

fn number<'t>(number: f32) -> Expression<'t> {
    Number::of(number.into())
}

/// Fields as C declares them; truth values last, since they are small.
#[derive(Default)]
struct Declared {
    numbers: Vec<String>,
    truths: Vec<String>,
    kept: Kept,
}

impl<T> See<T> for Declared {
    fn number(&mut self, name: &'static str, _: &mut T) {
        self.numbers.push(format!("float {name};"));
        self.kept.numbers.push(name.to_owned());
    }

    fn truth(&mut self, name: &'static str, _: &mut bool) {
        self.truths.push(format!("unsigned char {name};"));
        self.kept.truths.push(name.to_owned());
    }

    fn maybe<const K: usize>(&mut self, name: &'static str, _: &mut Option<[T; K]>) {
        self.truths.push(format!("unsigned char has_{name};"));
        self.kept.truths.push(format!("has_{name}"));
        self.list::<K>(name);
    }

    fn numbers<const K: usize>(&mut self, name: &'static str, _: &mut [T; K]) {
        self.list::<K>(name);
    }
}

impl Declared {
    fn list<const K: usize>(&mut self, name: &str) {
        self.numbers.push(if K == 1 { format!("float {name};") } else { format!("float {name}[{K}];") });
        let entry = |k: usize| if K == 1 { name.to_owned() } else { format!("{name}[{k}]") };
        self.kept.numbers.extend((0..K).map(entry));
    }
}
