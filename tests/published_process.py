"""What the log of the paper's own code prints (agranadoseu/Hyperelastic-Generative-Model, its data/new1)."""

import numpy as np

from warpbrain.gp.coregionalised import Parameters

#: Noise that the log of the paper's code adds to every observation (GPy's exact inference).
ADDED = 1e-8
#: The optimum that it prints.
STORED = Parameters(
    0.17952169955079822,
    np.array([
        135.62322427, 140.19158171, 139.05693858, 144.09968574, 132.12044589, 130.63714967, 132.04573204, 111.48076940,
        162.41944820, 150.77294496, 1.14076632, 142.69312541,
    ]),
    np.array([
        0.54158171, 1.31525233, 0.59139394, 4.79552641, 0.06334509, 1e-12, 0.09639896, 0.24035776, 9.95848127,
        18.40784199, 47.73588957, 1.41217720,
    ]),
    ADDED + np.array([
        0.24272512, 0.56619040, 0, 0, 0, 0, 1.32708317, 9.58898804, 0.13273581, 0.10883199, 0.80525181, 0,
    ]),
)  # fmt: skip
#: Negative log marginal likelihood.
OBJECTIVE = 7097.957
#: Fits to its curves at 101 stretches: neo-Hookean mu [Pa] at k = 0, -2, 2, Mooney-Rivlin C1, C2 [Pa] and Ogden
#: mu [Pa], alpha with the exponent up to 5 and up to 50, at k = 0.
FITS = {
    "MRE/grey matter": ((5725.58, 2116.93, 15432.87), (2864.13, 0.1), (3750.82, 3.05), (3750.9, 3.05)),
    "MRE/white matter": ((9197.15, 2015.24, 41736.45), (4600.79, 0.1), (6002.61, 3.07), (6002.65, 3.07)),
    "MRE/brain": ((3472.14, 3393.75, 3552.33), (1738.12, 0.1), (2282.14, 3.05), (2282.14, 3.05)),
    "MRE/abnormal": ((1355853.37, 1324311.68, 1388146.28), (677913.78, 0.34), (898040.02, 3.02), (898069.32, 3.02)),
    "linear/grey matter": ((2761.19, 2651.1, 2875.84), (1380.18, 0.1), (1906.71, 2.89), (1906.71, 2.89)),
    "linear/white matter": ((1378.28, 1323.84, 1434.95), (688.81, 0.1), (947.53, 2.91), (947.53, 2.91)),
    "linear/brain": ((835.41, 80.54, 8434.57), (417.58, 0.1), (553.13, 3.02), (553.13, 3.02)),
    "linear/abnormal": ((682.46, 0.97, 339528.2), (339.69, 0.1), (567.33, 2.4), (567.33, 2.4)),
    "hyperelastic/grey matter": ((1115.65, 532.1, 2334.15), (0.1, 557.77), (-444.33, -5), (-77.21, -25.72)),
    "hyperelastic/white matter": ((619.64, 316.59, 1212.35), (0.1, 309.86), (-246.87, -5), (-33, -31.57)),
    "hyperelastic/brain": ((552.41, 89.39, 3410.3), (0.1, 270.82), (-200.74, -5), (-176.98, -5.56)),
    "hyperelastic/abnormal": ((29980.84, 26449.84, 33983.1), (14985.18, 5.2), (29943.19, 2), (29943.19, 2)),
}
