-- Charts that a study's manifest asks for, as JSON like its claims.
ALTER TABLE studies ADD COLUMN sweeps_json TEXT NOT NULL DEFAULT '[]';
