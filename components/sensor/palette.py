"""The palette: one colour and marker for each kind of block, alike in every figure.

The colours are Okabe and Ito's, the laser's Tol's, told apart with any kind of colour vision.
Sensors see the same target in the same place: big open marks and small filled ones keep all of them
visible.
"""

from dsa_des.block.mark import BLUE, GREEN, ORANGE, PINK, RED, SKY, Mark

EO = Mark(BLUE, "o", 7.5)
IR = Mark(ORANGE, "^", 6.0)
RADAR = Mark(RED, "s", 4.0)
LASER = Mark("#117733", "*", 6.0)
EYES = Mark("#AA4499", "p", 6.0)
FUSION = Mark(GREEN, "D", 5.0)
COOPERATIVE = Mark(SKY, "P", 5.5)
TRACKER = Mark(PINK, "v", 5.5)
