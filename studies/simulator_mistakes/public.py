"""What public simulators got wrong, as rows of the study, and a log that one of them would write.

Takes nothing; read off their sources and threads, named in `SIMULATORS`. No code of theirs is here.
"""

from __future__ import annotations

from bayesid.model.effects import Effect, EffectParameter

# simulator, what it does, its source, row of the study that is the same in our rows
SIMULATORS = (
    (
        "Python Vehicle Simulator, remus100",
        "sets four elements of C_A to zero: in the plane the Munk moment (Y_vdot - X_udot) u v is gone",
        "cybergalactic/PythonVehicleSimulator, vehicles/remus100.py",
        "Munk moment missing",
    ),
    (
        "UUV Simulator before November 2016",
        "C_A with the sign turned",
        "uuvsimulator/uuv_simulator, issue 2 and pull request 7",
        "added-mass Coriolis of the wrong sign",
    ),
    (
        "Gazebo Hydrodynamics before November 2022",
        "diagonal damping; C_A holds Z_wdot w where the yaw row needs Y_vdot v: no N_v from sway",
        "gazebosim/gz-sim, src/systems/hydrodynamics before pull request 1784",
        "no cross terms",
    ),
    (
        "Gazebo Hydrodynamics since then",
        "a coefficient yVV of older files multiplies v v, where it multiplied v |v|",
        "gazebosim/gz-sim, pull requests 1784 and 1888",
        "sign of v v lost in the log",
    ),
)
SIGN_LOST = Effect(
    name="sign_lost",
    family="simulator",
    port="force",
    where=("Y", "N", "Y+N"),
    parameters=(EffectParameter("share", "-", 1.0, low=0, high=1, about="of v v for v|v|, r r for r|r|"),),
    force={
        "Y": "share*(coef('Y_v|v|')*v*(v - abs(v)) + coef('Y_r|r|')*r*(r - abs(r)))",
        "N": "share*(coef('N_v|v|')*v*(v - abs(v)) + coef('N_r|r|')*r*(r - abs(r)))",
    },
    source="gazebosim/gz-sim, pull request 1888",
    magnitude="the whole quadratic damping at one side",
)
