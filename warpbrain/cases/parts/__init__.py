"""The parts of a case, each read from its tables and files; faults are noted as problems and reading goes on."""
