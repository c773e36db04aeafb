"""Does the quantile help a walking robot, in the twins and on the real one?"""
