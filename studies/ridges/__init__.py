"""Study: which of vv, vr, rr do runs know, and do four ways of asking agree?"""
