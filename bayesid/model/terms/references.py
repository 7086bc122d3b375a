"""Where rows, propulsion models and vehicle sets come from, one full reference per key.

Takes: nothing. Does not: judge; a key that is used and missing here fails a test.
"""

from __future__ import annotations

REFERENCES = {
    "gertler1967": "Gertler, M. and Hagen, G. R. (1967). Standard equations of motion for submarine "
    "simulation. NSRDC Report 2510, AD 653861.",
    "feldman1979": "Feldman, J. (1979). DTNSRDC revised standard submarine equations of motion. "
    "DTNSRDC/SPD-0393-09, ADA071804.",
    "healey1993": "Healey, A. J. and Lienard, D. (1993). Multivariable sliding mode control for autonomous "
    "diving and steering of unmanned underwater vehicles. IEEE J. Oceanic Eng. 18(3), 327-339.",
    "prestero2001": "Prestero, T. (2001). Verification of a six-degree of freedom simulation model for the "
    "REMUS autonomous underwater vehicle. MSc thesis, MIT/WHOI.",
    "dasilva2007": "da Silva, J., Terra, B., Martins, R. and Sousa, J. (2007). Modeling and simulation of "
    "the LAUV autonomous underwater vehicle. 13th IEEE IFAC Int. Conf. Methods and Models in Automation "
    "and Robotics; equations as coded in LSTS DUNE (DUNE/Control/AUVModel).",
    "abkowitz1964": "Abkowitz, M. A. (1964). Lectures on ship hydrodynamics: steering and manoeuvrability. "
    "Hydro- og Aerodynamisk Laboratorium, Lyngby, Report Hy-5.",
    "yasukawa2015": "Yasukawa, H. and Yoshimura, Y. (2015). Introduction of MMG standard method for ship "
    "maneuvering predictions. J. Mar. Sci. Technol. 20, 37-52. doi:10.1007/s00773-014-0293-y.",
    "roddy1990": "Roddy, R. F. (1990). Investigation of the stability and control characteristics of "
    "several configurations of the DARPA SUBOFF model from captive-model experiments. DTRC/SHD-1298-08.",
    "fossen2021": "Fossen, T. I. (2021). Handbook of marine craft hydrodynamics and motion control, "
    "2nd edition. Wiley.",
    "yoshimura2009": "Yoshimura, Y., Nakao, I. and Ishibashi, A. (2009). Unified mathematical model for "
    "ocean and harbour manoeuvring. Proc. MARSIM 2009, 116-124.",
    "miyauchi2022": "Miyauchi, Y., Maki, A., Umeda, N., Rachman, D. M. and Akimoto, Y. (2022). System "
    "parameter exploration of ship maneuvering model for automatic docking/berthing using CMA-ES. J. Mar. "
    "Sci. Technol. 27, 1065-1083. doi:10.1007/s00773-022-00889-3.",
}
