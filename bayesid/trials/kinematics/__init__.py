"""What the channels of a log say of one another by kinematics alone, without any force.

Takes runs. Gives relations between channels as regressions (`relations`), their evidence (`evidence`) and the
errors of the instruments they reveal (`instruments`).
Does not: know a vehicle, or judge what is a mistake (`bayesid.trials.mistakes`).
"""
