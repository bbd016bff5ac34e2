"""How fast is a run, and compared with what?"""
