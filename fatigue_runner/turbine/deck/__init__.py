"""From an OpenFAST deck to a turbine file: its files (`text`, `files`), what they mean here (`convert`, `rosco`), what the model leaves
out of them (`omissions`), and the YAML that is written (`written`, `importing`)."""
