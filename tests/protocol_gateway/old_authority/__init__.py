"""The control of one robot as it was before `RobotAuthority`: the oracle of `test_authority_oracle`."""
