-- What an adviser chose for each place of a study, as JSON: beside the full matrix, its regret.
ALTER TABLE studies ADD COLUMN advice_json TEXT NOT NULL DEFAULT '[]';
