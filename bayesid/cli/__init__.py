"""The command line `bayesid`: reads options, calls the library, prints answers.

Takes arguments of a shell. Does not compute; a command imports what it needs when it runs, so that
`bayesid --help` loads no numerical library. `main` holds the entry point, `terminal` what every command
shares.
"""
