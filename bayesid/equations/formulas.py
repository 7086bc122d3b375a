"""Newton-Euler, statics, kinematics, moving water, thrust curve and lever arm as formulas.

Symbols are those of `layout` and `declare`. Holds text only; `dynamics` parses it.
"""

from __future__ import annotations

from bayesid.model.vehicles import GRAVITY

# Newton-Euler about the body origin, products of inertia I_xy = +integral of xy dm (Gertler & Hagen 1967).
RIGID_BODY = {
    "X": "m*(udot - v*r + w*q - x_G*(q*q + r*r) + y_G*(p*q - rdot) + z_G*(p*r + qdot))",
    "Y": "m*(vdot - w*p + u*r - y_G*(r*r + p*p) + z_G*(q*r - pdot) + x_G*(q*p + rdot))",
    "Z": "m*(wdot - u*q + v*p - z_G*(p*p + q*q) + x_G*(r*p - qdot) + y_G*(r*q + pdot))",
    "K": "Ixx*pdot + (Izz - Iyy)*q*r - (rdot + p*q)*Ixz + (r*r - q*q)*Iyz + (p*r - qdot)*Ixy"
    " + m*(y_G*(wdot - u*q + v*p) - z_G*(vdot - w*p + u*r))",
    "M": "Iyy*qdot + (Ixx - Izz)*r*p - (pdot + q*r)*Ixy + (p*p - r*r)*Ixz + (q*p - rdot)*Iyz"
    " + m*(z_G*(udot - v*r + w*q) - x_G*(wdot - u*q + v*p))",
    "N": "Izz*rdot + (Iyy - Ixx)*p*q - (qdot + r*p)*Iyz + (q*q - p*p)*Ixy + (r*q - pdot)*Ixz"
    " + m*(x_G*(vdot - w*p + u*r) - y_G*(udot - v*r + w*q))",
}
STATICS = {
    "X": "-(W - B)*sin(theta)",
    "Y": "(W - B)*cos(theta)*sin(phi)",
    "Z": "(W - B)*cos(theta)*cos(phi)",
    "K": "(y_G*W - y_B*B)*cos(theta)*cos(phi) - (z_G*W - z_B*B)*cos(theta)*sin(phi)",
    "M": "-(x_G*W - x_B*B)*cos(theta)*cos(phi) - (z_G*W - z_B*B)*sin(theta)",
    "N": "(x_G*W - x_B*B)*cos(theta)*sin(phi) + (y_G*W - y_B*B)*sin(theta)",
}
KINEMATICS_3 = {"x": "u*cos(psi) - v*sin(psi)", "y": "u*sin(psi) + v*cos(psi)", "psi": "r"}
KINEMATICS_6 = {
    "x": "u*cos(theta)*cos(psi) + v*(sin(phi)*sin(theta)*cos(psi) - cos(phi)*sin(psi))"
    " + w*(sin(phi)*sin(psi) + cos(phi)*cos(psi)*sin(theta))",
    "y": "u*cos(theta)*sin(psi) + v*(cos(phi)*cos(psi) + sin(phi)*sin(theta)*sin(psi))"
    " + w*(cos(phi)*sin(theta)*sin(psi) - sin(phi)*cos(psi))",
    "z": "-u*sin(theta) + v*cos(theta)*sin(phi) + w*cos(theta)*cos(phi)",
    "phi": "p + sin(theta)/cos(theta)*(q*sin(phi) + r*cos(phi))",
    "theta": "q*cos(phi) - r*sin(phi)",
    "psi": "(q*sin(phi) + r*cos(phi))/cos(theta)",
}
# Open-water curve K_T = Kt0 (1 - (J/a)^b), J = u (1 - w)/(n D) clipped at 0, thrust odd in n, n in rev/s.
_ADVANCE = "max(u*(1 - w_p)*60/(D*{zero}*(sgn(n)*max(abs(n), 1e-6) + (1 - abs(sgn(n)))*1e-6)), 0)"
KT_THRUST = f"(1 - t_p)*rho*D**4*Kt0*n*abs(n)/3600*(1 - ({_ADVANCE.format(zero='kt_a')})**kt_b)"
# The same for its torque, whose reaction on the hull is to port where it turns right-handed.
KT_TORQUE = f"-rho*D**5*Kq0*n*abs(n)/3600*(1 - ({_ADVANCE.format(zero='kq_a')})**kq_b)"
# Reaction of the propeller on the hull, `torque_ref` at the reference revolutions.
TORQUE = "torque_ref*n*abs(n)/rpm_ref**2"
# Velocity of the water in body axes; and what turning axes add to its rate: -omega x c.
CURRENT = {
    "u": "north*cos(theta)*cos(psi) + east*cos(theta)*sin(psi) - down*sin(theta)",
    "v": "north*(sin(phi)*sin(theta)*cos(psi) - cos(phi)*sin(psi))"
    " + east*(cos(phi)*cos(psi) + sin(phi)*sin(theta)*sin(psi)) + down*cos(theta)*sin(phi)",
    "w": "north*(sin(phi)*sin(psi) + cos(phi)*cos(psi)*sin(theta))"
    " + east*(cos(phi)*sin(theta)*sin(psi) - sin(phi)*cos(psi)) + down*cos(theta)*cos(phi)",
}
SWING = {"u": "r*vc - q*wc", "v": "p*wc - r*uc", "w": "q*uc - p*vc"}
# Water that accelerates by (ax, ay, az) carries a pressure gradient: it pushes what it surrounds, at the
# centre of buoyancy, as hard as the water displaced there (Thomasson & Woolsey 2013, IEEE J. Oceanic Eng.).
# The acceleration is that of the water at a place; an uneven current that is only crossed has none.
PRESSURE_GRADIENT = {
    "X": f"B/{GRAVITY!r}*ax",
    "Y": f"B/{GRAVITY!r}*ay",
    "Z": f"B/{GRAVITY!r}*az",
    "K": f"B/{GRAVITY!r}*(y_B*az - z_B*ay)",
    "M": f"B/{GRAVITY!r}*(z_B*ax - x_B*az)",
    "N": f"B/{GRAVITY!r}*(x_B*ay - y_B*ax)",
}
# Position of the measured point of the hull.
LEVER = {
    "x": "x + point_x*cos(theta)*cos(psi) + point_y*(sin(phi)*sin(theta)*cos(psi) - cos(phi)*sin(psi))"
    " + point_z*(sin(phi)*sin(psi) + cos(phi)*cos(psi)*sin(theta))",
    "y": "y + point_x*cos(theta)*sin(psi) + point_y*(cos(phi)*cos(psi) + sin(phi)*sin(theta)*sin(psi))"
    " + point_z*(cos(phi)*sin(theta)*sin(psi) - sin(phi)*cos(psi))",
    "z": "z - point_x*sin(theta) + point_y*cos(theta)*sin(phi) + point_z*cos(theta)*cos(phi)",
}
ETA = "uc_per_rpm*n/sqrt(max(u*u + v*v + w*w, 1e-6)) - 1"
# A sign without a jump, for x clipped at -1 and 1; two continuous derivatives.
ROUNDED_SIGN = "x*(15 - x*x*(10 - 3*x*x))/8"
