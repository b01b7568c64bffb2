//! Common steps of the filters of hypotheses: in place, into an existing state, backwards, and as an
//! [`Estimator`](crate::Estimator), whose prepared step is the filter itself for steps of that length.

/// Step length and [`Estimator`](crate::Estimator) of a filter whose state is `$state`.
macro_rules! mixture_filter {
    ($filter:ident<$($size:ident),+>, $state:ident<$($of_state:ident),*>) => {
        impl<T: Real, $(const $size: usize,)+ S: Switch<T>, G: Curve<T>> $filter<T, $($size,)+ S, G> {
            /// The model.
            pub const fn model(&self) -> &SwitchedModel<T, B, N> {
                self.kernel.model()
            }

            /// Changes the length of steps.
            ///
            /// # Errors
            /// If `dt_s` is negative or not finite; the filter is then unchanged.
            pub fn retime(&mut self, dt_s: T) -> Result<(), StepError> {
                $crate::clock::check_time_step(dt_s)?;
                *self = self.every(dt_s);
                Ok(())
            }
        }

        impl<T: Real, $(const $size: usize,)+ S: Switch<T>, G: Curve<T>, const L: usize> $crate::Estimator<T, N, L>
            for $filter<T, $($size,)+ S, G>
        {
            type State = $state<T, N, L $(, $of_state)*>;
            /// The filter for steps of that length.
            type Prepared = Self;

            fn prepare(&self, dt_s: T) -> Self {
                self.every(dt_s)
            }

            fn longest_step_s(&self) -> T {
                self.longest_s()
            }

            fn advance(
                &self,
                state: &Self::State,
                prepared: &Self,
                reading: Option<Reading<T>>,
            ) -> Result<$crate::Advanced<Self::State, T>, StepError> {
                let mut next = $state::empty();
                let innovation = $crate::Estimator::advance_into(self, state, prepared, reading, &mut next)?;
                Ok($crate::Advanced { state: next, innovation })
            }

            fn advance_into(
                &self,
                state: &Self::State,
                prepared: &Self,
                reading: Option<Reading<T>>,
                next: &mut Self::State,
            ) -> Result<Option<$crate::Innovation<T>>, StepError> {
                prepared.step_into(state, reading, next)?.map(|residual| residual.innovation()).transpose()
            }

            fn smooth_back(
                &self,
                filtered: &Self::State,
                prepared: &Self,
                reading: Option<Reading<T>>,
                next: &Self::State,
            ) -> Result<Self::State, StepError> {
                prepared.back(filtered, reading, next)
            }
        }
    };
}
pub(crate) use mixture_filter;

/// Constructor and time step of a filter over a chain of all phases.
macro_rules! over_phases {
    ($filter:ident<$($size:ident),+>) => {
        impl<T: Real, $(const $size: usize),+> $filter<T, $($size),+> {
            /// A filter for steps of `dt_s` seconds.
            /// - `dwell`: durations of phases and transitions between them.
            /// - `evidence`: evidence that weighs the hypotheses.
            ///
            /// # Errors
            /// If `dt_s` is negative or not finite.
            pub fn new(
                model: SwitchedModel<T, B, N>,
                dt_s: T,
                dwell: Dwell<T>,
                evidence: Evidence<T>,
            ) -> Result<Self, StepError> {
                Ok(Self::around(SparseEkf::of_any_length(model, dt_s)?, dwell, evidence))
            }
        }

        impl<T: Real, $(const $size: usize,)+ S: Switch<T>, G: Curve<T>> $filter<T, $($size,)+ S, G> {
            /// Creates a filter whose hypotheses step like `kernel`; the other arguments are those of [`Self::new`]. Only
            /// the square root of the kernel's switch is used.
            pub fn around(kernel: SparseEkf<T, S, B, N, G>, dwell: Dwell<T>, evidence: Evidence<T>) -> Self {
                Self {
                    dwell,
                    chain: dwell.probabilities(kernel.dt_s()),
                    weighing: Weighing::new(evidence),
                    fresh: Phase::ALL.map(|phase| fresh_rate(kernel.model().motion(), phase)),
                    kernel,
                }
            }

            /// Returns the longest step, s. A phase changes at the beginning of a step, so steps must be short compared
            /// with phases, and within the model's limit.
            fn longest_s(&self) -> T {
                self.model().longest_step_s().min(self.dwell.longest_step_s())
            }

            /// Returns the filter for steps of another length.
            fn every(&self, dt_s: T) -> Self {
                let mut other = *self;
                other.kernel.set_length(dt_s);
                other.chain = other.dwell.probabilities(dt_s);
                other
            }
        }
    };
}
pub(crate) use over_phases;

/// Steps of a filter that [spawns](crate::mixture::spawn::Spawns) a new [`Mixture`](crate::Mixture): forward, and backwards
/// along the same children.
macro_rules! mixture_steps {
    () => {
        /// Predicts one step ahead and takes the reading. Without a reading it only predicts, and returns `None`.
        ///
        /// # Errors
        /// See [`StepError`]; the state is unchanged.
        #[inline]
        pub fn step<const L: usize>(
            &self,
            state: &mut Mixture<T, N, L, K>,
            reading: Option<Reading<T>>,
        ) -> Result<Option<MixtureResidual<T>>, StepError> {
            let mut next = Mixture::empty();
            let residual = match reading {
                Some(reading) => self.step_to(state, reading, &mut next),
                None => self.step_to(state, reading, &mut next),
            }?;
            *state = next;
            Ok(residual)
        }

        /// Writes the result of [`Self::step`] into an existing state, which saves a move.
        ///
        /// # Errors
        /// See [`StepError`]; `next` is then meaningless.
        #[inline]
        pub fn step_into<const L: usize>(
            &self,
            state: &Mixture<T, N, L, K>,
            reading: Option<Reading<T>>,
            next: &mut Mixture<T, N, L, K>,
        ) -> Result<Option<MixtureResidual<T>>, StepError> {
            self.step_to(state, reading, next)
        }

        #[inline(always)]
        fn step_to<const L: usize>(
            &self,
            state: &Mixture<T, N, L, K>,
            reading: impl StepReading<T>,
            next: &mut Mixture<T, N, L, K>,
        ) -> Result<Option<MixtureResidual<T>>, StepError> {
            match self.step_once(state, reading, next) {
                Err(refused) => self.retry_step(state, reading, refused, next),
                taken => taken,
            }
        }

        /// Steps once. Never inlined, so that a program contains it once, for all tries.
        #[inline(never)]
        fn step_once<const L: usize>(
            &self,
            state: &Mixture<T, N, L, K>,
            reading: impl StepReading<T>,
            next: &mut Mixture<T, N, L, K>,
        ) -> Result<Option<MixtureResidual<T>>, StepError> {
            self.step_recorded(state, reading.as_option(), next, &mut ())
        }

        #[cold]
        #[inline(never)]
        fn retry_step<const L: usize>(
            &self,
            state: &Mixture<T, N, L, K>,
            mut reading: impl StepReading<T>,
            mut refused: StepError,
            next: &mut Mixture<T, N, L, K>,
        ) -> Result<Option<MixtureResidual<T>>, StepError> {
            let (mut from, mut tries) = (*state, 0);
            loop {
                tries += 1;
                reading = reading.for_retry(&self.kernel, tries, refused)?;
                loosen(from.shares_mut(), tries);
                match self.step_once(&from, reading, next) {
                    Err(error) => refused = error,
                    taken => return taken,
                }
            }
        }

        /// Steps once, and passes the children to a recorder.
        #[inline(always)]
        fn step_recorded<const L: usize>(
            &self,
            state: &Mixture<T, N, L, K>,
            reading: Option<Reading<T>>,
            next: &mut Mixture<T, N, L, K>,
            recorder: &mut impl Recorder<T, B>,
        ) -> Result<Option<MixtureResidual<T>>, StepError> {
            let pause = self.pause_after(state.pause(), reading.is_some());
            let (open, branches) = (pause.open, PhantomData);
            let residual =
                MixtureStep { filter: self, state, reading, next: &mut *next, open, branches }.done(recorder)?;
            next.set_pause(pause);
            Ok(residual)
        }

        fn back<const L: usize>(
            &self,
            filtered: &Mixture<T, N, L, K>,
            mut reading: Option<Reading<T>>,
            next: &Mixture<T, N, L, K>,
        ) -> Result<Mixture<T, N, L, K>, StepError> {
            let (mut components, mut smoothed, mut tries) = (Mixture::empty(), *filtered, 0);
            // With the same tries as forward.
            let following = loop {
                let mut following = Following::<T, B, N, L, K>::new(self.model(), self.kernel.dt_s());
                match self.step_recorded(&smoothed, reading, &mut components, &mut following) {
                    Ok(_) => break following,
                    Err(refused) => {
                        tries += 1;
                        reading = reading.for_retry(&self.kernel, tries, refused)?;
                        loosen(smoothed.shares_mut(), tries);
                    }
                }
            };
            following.lineage.smooth(smoothed.shares_mut(), components.shares(), next.shares());
            Ok(smoothed)
        }
    };
}
pub(crate) use mixture_steps;
