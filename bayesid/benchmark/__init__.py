"""Checks of the diagnosis by campaigns whose answer is known: an independent plant and a blind protocol.

The plant shares no equation with the model under test. Nothing imports this package but studies and `bayesid
blind`.
"""
