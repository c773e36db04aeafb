"""How well can three seconds be foreseen, and how honest is the uncertainty?"""
