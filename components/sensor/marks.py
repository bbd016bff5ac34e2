"""The palette: one colour and marker for each kind of block, alike in every figure.

The colours are Okabe and Ito's, the laser's Tol's, told apart with any kind of colour vision.
Sensors see the same target in the same place: big open marks and small filled ones keep all of them
visible.
"""

from dsa_des.block.mark import Mark

EO = Mark("#0072B2", "o", 7.5)
IR = Mark("#E69F00", "^", 6.0)
RADAR = Mark("#D55E00", "s", 4.0)
LASER = Mark("#117733", "*", 6.0)
EYES = Mark("#AA4499", "p", 6.0)
FUSION = Mark("#009E73", "D", 5.0)
COOPERATIVE = Mark("#56B4E9", "P", 5.5)
TRACKER = Mark("#CC79A7", "v", 5.5)
