"""What a series may be by its name and unit alone: roles, and how sure the name is.

One table, `PATTERNS`. Does not: look at numbers.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from bayesid.model.channels import ACTUATORS, COMMANDS, is_channel
from bayesid.model.units import UnitError, scale
from bayesid.trials.importing.raw import RawChannel
from bayesid.trials.importing.roles import ROLES
from bayesid.trials.importing.tables import plain

ORDERED = re.compile(
    r"\b(cmd|command|commanded|order|ordered|set|setpoint|set point|sp|demand|demanded|desired|des|target|"
    r"ref|reference|"
    r"soll|ordre|req|requested|input|order|goal)\b"
)
MEASURED = re.compile(
    r"\b(act|actual|meas|measured|fb|feedback|ist|encoder|state|response|reported|sensor)\b"
)
OTHER = re.compile(
    r"\b(raw|std|sigma|sd|var|variance|cov|covariance|err|error|count|status|valid|quality|flag|mode|"
    r"current|voltage|"
    r"power|temperature|temp|relative|apparent|bias|offset|age|num|satellites|limit|max|min|gain|hdop|"
    r"accuracy)\b"
)
# the wind as a moving vehicle has it
APPARENT = re.compile(r"\b(app|apparent|rel|relative|aws|awa|awd)\b")
# axes that a name may state; of a velocity they tell another role, as in vel_ned_y
AXES = re.compile(r"\b(ned|enu|nwu)\b")
_IN_AXES = frozenset({"x", "y", "z", "phi", "theta", "psi", "qw", "qx", "qy", "qz"})
_OF_AXES = 0.1  # taken off the score of a name without its axes
# role -> words of the field, tried against the name without unit; the first group of roles is the surest
PATTERNS: tuple[tuple[str, str], ...] = (
    ("latitude", r"lat|latitude|gps lat|breite|lat deg"),
    ("longitude", r"lon|lng|long|longitude|gps lon|länge|lon deg"),
    ("heading", r"heading|hdg|head|compass|true heading|heading true|gyro heading|kurs|kompass|"
                r"compass heading|cap|hdt|gyrocompass"),
    ("course", r"cog|course|course over ground|track angle|gps course"),
    ("speed_over_ground", r"sog|speed over (the )?ground|speed ov(er)? grd|ground speed|gps speed|gps sog|"
                          r"fü ?g|fahrt über grund"),
    ("speed_through_water", r"stw|speed (through|thru) (the )?water|water speed|log speed|speed log|"
                            r"fd ?w|fahrt durchs wasser"),
    ("v_north", r"v n|vn|vel n|vel north|velocity north|north vel(ocity)?|v nor(th|d)|speed north|"
                r"ve?l? ?ned ?x"),
    ("v_east", r"v e|ve|vel e|vel east|velocity east|east vel(ocity)?|v (ea|o)st|speed east"),
    ("v_down", r"v d|vd|vel d|vel down|velocity down|down vel(ocity)?|v down"),
    ("north", r"north|northing|pos n|n pos|pos north|north pos(ition)?|position north|x north|"
              r"utm n(orthing)?|y utm|nord(wert)?|pos nord|hochwert"),
    ("east", r"east|easting|pos e|e pos|pos east|east pos(ition)?|position east|y east|utm e(asting)?|x utm|"
             r"(o|ø|ö)st(wert)?|pos ost|rechtswert"),
    ("qw", r"qw|q w|quat w|quaternion w|orientation w|q0|q 0"),
    ("qx", r"qx|q x|quat x|quaternion x|orientation x|q1|q 1"),
    ("qy", r"qy|q y|quat y|quaternion y|orientation y|q2|q 2"),
    ("qz", r"qz|q z|quat z|quaternion z|orientation z|q3|q 3"),
    ("depth", r"depth|tiefe|immersion|depth m|pressure depth|ctd depth|profondeur"),
    ("height", r"height|gps alt(itude)?|ellipsoid(al)? height|alt|altitude"),
    ("x", r"x|px|pos x|x pos(ition)?|position x|x 0|x0|pose x|x position mid|loc x|local x|x earth|"
          r"x (basin|tank|pool|lab)|(basin|tank|pool|lab) x"),
    ("y", r"y|py|pos y|y pos(ition)?|position y|y0|pose y|y position mid|loc y|local y|y earth|"
          r"y (basin|tank|pool|lab)|(basin|tank|pool|lab) y"),
    ("z", r"z|pz|pos z|z pos(ition)?|position z|pose z|loc z|local z|"
          r"z (basin|tank|pool|lab)|(basin|tank|pool|lab) z"),
    ("phi", r"roll|phi|φ|heel|roll angle|rollwinkel"),
    ("theta", r"pitch|theta|θ|trim|pitch angle"),
    ("psi", r"yaw|psi|ψ|yaw angle|psi hat|orientation|gier(winkel)?"),
    ("r", r"r|yaw rate|yawrate|rot|rate of turn|turn rate|gyro z|gz|wz|omega z|angular vel(ocity)? z|"
          r"yaw ?speed|psi dot|"
          r"r angvelo|heading rate|gyr z|yaw velocity|w z|ang vel z|drehrate|svingrate"),
    ("p", r"p|roll rate|rollrate|gyro x|gx|wx|omega x|angular vel(ocity)? x|roll ?speed|gyr x|w x|ang vel x"),
    ("q", r"q|pitch rate|pitchrate|gyro y|gy|wy|omega y|angular vel(ocity)? y|pitch ?speed|gyr y|w y|"
          r"ang vel y"),
    ("u_water", r"u water|vx water|dvl water x|surge water"),
    ("v_water", r"v water|vy water|dvl water y|sway water"),
    ("u", r"u|surge|vx|vel x|u velo|surge vel(ocity)?|surge speed|vx body|body vx|u body|forward speed|"
          r"fahrt|fart|"
          r"dvl x|dvl vx|bt x|(dvl|bt|bottom track) (vel(ocity)? )?(fwd|forward|ahead|surge|u)|"
          r"linear x|velocity x|forward vel(ocity)?|u ground|v x|speed|velocity|geschwindigkeit|"
          r"long(itudinal)? speed|speed (fwd|forward|ahead|surge|long(itudinal)?)"),
    ("v", r"v|sway|vy|vel y|vm velo|sway vel(ocity)?|sway speed|vy body|body vy|v body|dvl y|dvl vy|bt y|"
          r"linear y|velocity y|"
          r"(dvl|bt|bottom track) (vel(ocity)? )?(stbd|starboard|port|sway|lateral|transverse|athwart|v)|"
          r"sway (to )?(stbd|starboard|port)|"
          r"lateral (speed|velocity)|v ground|v y|transverse speed|"
          r"speed (stbd|starboard|sway|lateral|transverse|athwart)"),
    ("w", r"w|heave|vz|vel z|heave vel(ocity)?|vz body|w body|dvl z|dvl vz|velocity z|v z|"
          r"heave speed|vertical (speed|velocity)|speed (down|heave|vertical)|bt z|"
          r"(dvl|bt|bottom track) (vel(ocity)? )?(down|up|heave|vertical|w)|heave (down|up)"),
    ("delta_r", r"rudder|rud|helm|ruder|ruderlage|delta r|deltar|delta|δ|delta rudder|rudder angle|dr|"
                r"steer|steering|tiller|"
                r"steering angle|(vertical|yaw) (fins?|planes?|rudders?)( angle)?|fins? (vertical|yaw)|"
                r"rudder pos(ition)?|rudderangle|barre|"
                r"ror(vinkel)?"),
    ("delta_s", r"stern ?plane|stern ?planes|elevators?|delta s|delta e|stern|hydroplanes?|"
                r"(horizontal|pitch|stern|dive|diving) ?(fins?|planes?|rudders?)( angle)?|"
                r"fins? (horizontal|pitch)|tiefenruder|"
                r"stern plane angle|stern ?plane pos(ition)?|elevator angle"),
    ("delta_b", r"bow ?plane|bow ?planes|delta b|bow plane angle|sail ?plane"),
    ("n", r"n|rpm|rps|n prop|prop(eller)?|prop(eller)? (rpm|rps|speed|rev|revs|revolutions)|shaft|"
          r"shaft (rpm|speed|rev)|revs|"
          r"screw|screw speed|motor (rpm|speed)|(main )?eng(ine)? (rpm|speed|revs?)|thruster (rpm|speed)|"
          r"(motor|wellen|propeller)?drehzahl|turtall|main rpm|"
          r"rotation rate|"
          r"propeller rate|prop rate|shaft rate"),
    ("thrust", r"thrust|prop(eller)? thrust|schub"),
    ("torque", r"torque|prop(eller)? torque|drehmoment"),
    ("wind_speed", r"(true )?wind (speed|vel(ocity)?)|tws|true wind|wind velo true|wind speed true|"
                   r"windgeschwindigkeit|aws"),
    ("wind_from", r"(true )?wind (dir|direction|from)|twd|wind (dir|direction|from) true|windrichtung|"
                  r"awa|awd|twa|(true |app )?wind angle"),
)  # fmt: skip
_OWN_HEADER = re.compile(r"([A-Za-z_]\w*)\[[^\[\]]+\]")
_COMPILED = tuple((role, re.compile(rf"(?:{pattern})")) for role, pattern in PATTERNS)
ABSOLUTE = frozenset({"latitude", "longitude", "north", "east", "heading", "v_north", "v_east", "course"})
FIELD = 1.9  # score of the field of a struct
_SENSOR = re.compile(r"acc|gyr|imu|mag|force|vel|rate|wind|curr|cmd|order")
_STEERED = frozenset({*COMMANDS, *ACTUATORS} - {"n", "n_cmd"})
WITH_ORDER = ("delta_r", "delta_s", "delta_b", "n")


@dataclass(frozen=True)
class Guess:
    """role: what it may be; score: 3 by the format's definition, 2 the whole name, 1 its end; ordered: True
    for a command, False for a measurement, None where the name does not say."""

    role: str
    score: float
    ordered: bool | None = None


def in_bundle_format(names: Iterable[str]) -> bool:
    """True if a table is written as the CSV files of a bundle, position and heading too."""
    heads = [_OWN_HEADER.fullmatch(name) for name in names]
    own = {found[1] for found in heads if found is not None and is_channel(found[1])}
    return own >= {"x", "y", "psi"} and bool(own & _STEERED)


def guess_role(channel: RawChannel, own_format: bool = False) -> Guess | None:
    """The role a name and a unit fit; None if none. In a table of bayesid's own format only its own headers
    count."""
    if own_format:
        own = _OWN_HEADER.fullmatch(channel.name)
        return Guess(own[1], 3.0) if own is not None and own[1] in ROLES else None
    words = plain(channel.name.replace("/", " ").replace(".", " ").replace("(:,", " "))
    if channel.role:
        return Guess(channel.role, 3.0) if channel.role in ROLES else None
    ordered = True if ORDERED.search(words) else False if MEASURED.search(words) else None
    if ordered is None and "(" in channel.place:  # the type of a message says it too: ActuatorCommand
        kind = plain(channel.place.partition("(")[2].partition(")")[0].replace("/", " ").replace("_", " "))
        ordered = True if ORDERED.search(kind) else False if MEASURED.search(kind) else None
    bare = " ".join(MEASURED.sub(" ", ORDERED.sub(" ", words)).split())
    odd = bool(OTHER.search(words))
    less = 0.9 if odd or APPARENT.search(words) else 0.0
    kept = " ".join(OTHER.sub(" ", bare).split()) if odd else bare
    best: Guess | None = None
    tails = _tails(kept) + _field_of_struct(channel)
    if channel.unit in ("rpm", "rps"):  # engine_rpm is split into a name and a unit
        tails.append((f"{kept} {channel.unit}", 2.0))
    if channel.unit in ("deg/s", "rad/s") and not kept.endswith("rate"):  # gyro_yaw_dps is one of a rate
        tails += _tails(f"{kept} rate")
    without = " ".join(AXES.sub(" ", kept).split())
    in_axes = [] if without == kept else [(tail, score - _OF_AXES) for tail, score in _tails(without)]
    for role, pattern in _COMPILED:
        for tail, score in tails + (in_axes if role in _IN_AXES else []):
            if pattern.fullmatch(tail) and _fits(role, channel):
                if (len(tail) == 1 or tail in ("speed", "velocity")) and score < FIELD:
                    continue
                found = Guess(role, score - less, ordered if role in WITH_ORDER else None)
                if ordered and role not in WITH_ORDER:
                    continue  # a commanded heading or speed is no measurement
                if best is None or found.score > best.score:
                    best = found
    return best if best is not None and best.score > 0.2 else None


def role_of_name(name: str) -> str | None:
    """The role that the whole of a name without its unit tells; None if none."""
    nothing = np.zeros(0)
    found = guess_role(RawChannel(name, nothing, nothing))
    if found is None or found.score < 2.0:
        return None
    return f"{found.role}_cmd" if found.ordered and found.role in WITH_ORDER else found.role


def _field_of_struct(channel: RawChannel) -> list[tuple[str, float]]:
    """The field of a struct such as run.X of a MAT file, where the struct is no sensor of something else."""
    before, mark, last = channel.name.rpartition(".")
    if not mark or not channel.place.startswith("column") or _SENSOR.search(before.lower()):
        return []
    words = plain(last)
    return [] if OTHER.search(words) else [(MEASURED.sub(" ", ORDERED.sub(" ", words)).strip(), FIELD)]


def _tails(words: str) -> list[tuple[str, float]]:
    """The whole name, then its last words, then its first words."""
    parts = words.split()
    out = [(words, 2.0)]
    out += [(" ".join(parts[k:]), 1.5 - 0.05 * k) for k in range(1, len(parts))]
    out += [(" ".join(parts[:k]), 1.0 - 0.05 * (len(parts) - k)) for k in range(len(parts) - 1, 0, -1)]
    return out


def _fits(role: str, channel: RawChannel) -> bool:
    """True unless the unit stated is that of something else."""
    inside = ROLES[role].unit
    if channel.unit is None or channel.unit in ("%", "us_pwm"):
        return True
    if not inside:
        return False
    try:
        scale(channel.unit, inside, channel.name)
    except UnitError:
        return False
    return True
