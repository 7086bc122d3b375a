"""Logged trials: read, checked, windowed, written, summed up."""

from bayesid.trials.bundle import builtin_trials, load_trial
from bayesid.trials.frames import trial_from_frames
from bayesid.trials.summary import trial_summary
from bayesid.trials.trial import Channels, Environment, Run, Trial, channels_of
from bayesid.trials.window import resample, thin, window
from bayesid.trials.write import write_trial

__all__ = [
    "Channels",
    "Environment",
    "Run",
    "Trial",
    "builtin_trials",
    "channels_of",
    "load_trial",
    "resample",
    "thin",
    "trial_from_frames",
    "trial_summary",
    "window",
    "write_trial",
]
