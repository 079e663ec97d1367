//! Files of users and of the server: what may be sent, what a manifest may name, and
//! that nothing else of the machine is reached or told.

use super::server::{RUNS, Server, forget, furnish, raw, study};
use serde_json::{Value, json};
use std::path::Path;

fn names(dir: &Path) -> Vec<String> {
    let Ok(list) = std::fs::read_dir(dir) else { return Vec::new() };
    list.map(|e| e.unwrap().file_name().into_string().unwrap()).collect()
}

/// A folder `in` that the server offers, and what lies beside it.
fn confined() -> (Server, std::path::PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let (inside, outside) = (folder.path().join("in"), folder.path().join("out"));
    for dir in [&inside, &outside] {
        std::fs::create_dir(dir).unwrap();
        furnish(dir);
    }
    std::fs::write(outside.join("layer.toml"), "[measure]\nrepeats = 7\n").unwrap();
    std::fs::write(inside.join("layer.toml"), "[measure]\nrepeats = 2\n").unwrap();
    #[cfg(unix)]
    for (to, link) in
        [(outside.join("town.obj"), "link.obj"), (outside.join("layer.toml"), "link.toml"), (outside.clone(), "way")]
    {
        std::os::unix::fs::symlink(to, inside.join(link)).unwrap();
    }
    let server = Server::offering(folder, "in", &["--no-workers"]);
    let outside = outside.canonicalize().unwrap();
    (server, outside)
}

#[test]
fn a_manifest_names_files_of_the_offered_folder_and_none_beyond_it() {
    let (server, outside) = confined();
    let check = |manifest: &str| server.post("/studies", &json!({ "manifest": manifest, "validate_only": true }));
    check(&study("town")).with(200);
    let absolute = outside.join("town.obj").display().to_string();
    let absent = outside.join("absent.obj").display().to_string();
    let mut told = Vec::new();
    for file in
        ["../out/town.obj", &absolute, "link.obj", "way/town.obj", "./way/../../out/town.obj", &absent, "../x.db"]
    {
        let problem = check(&study("town").replace("\"town.obj\"", &format!("\"{file}\""))).problem(422);
        let e = &problem["errors"][0];
        assert!(e["key"].as_str().unwrap().contains("scene") && e["line"].is_number(), "{problem}");
        // What is there and what is not looks the same.
        told.push(e["message"].as_str().unwrap().replace(file, "FILE"));
        assert!(!problem.to_string().replace(file, "").contains(server.path().to_str().unwrap()), "{problem}");
    }
    told.dedup();
    assert_eq!(told.len(), 1, "{told:?}");
    for path in ["../out/walk.csv", "way/walk.csv", "/etc/passwd"] {
        check(&study("town").replace("\"walk.csv\"", &format!("\"{path}\""))).problem(422);
    }
    let absolute = outside.join("layer.toml").display().to_string();
    for layer in ["../out/layer.toml", "link.toml", "way/layer.toml", &absolute] {
        let problem = check(&format!("extends = \"{layer}\"\n{}", study("town"))).problem(422);
        assert!(!problem.to_string().replace(layer, "").contains(server.path().to_str().unwrap()), "{problem}");
        assert!(!problem.to_string().contains("repeats = 7"), "{problem} shows a file from outside");
    }
}

#[test]
fn a_run_takes_no_more_time_and_memory_than_the_server_gives() {
    let (server, _) = confined();
    let check = |set: &[&str]| {
        server.post("/studies", &json!({ "manifest": study("town"), "set": set, "validate_only": true }))
    };
    check(&["measure.timeout_s=3600", "measure.memory_limit_mib=8192"]).with(200);
    let problem = check(&["measure.timeout_s=3601", "measure.memory_limit_mib=8193"]).problem(422);
    for (i, key) in ["timeout_s", "memory_limit_mib"].iter().enumerate() {
        let e = &problem["errors"][i];
        assert_eq!(e["key"], format!("measure.{key}"), "{problem}");
        assert!(e["help"].as_str().unwrap().contains("serve --"), "{problem}");
    }
    server.submit(&study("town"));
    assert_eq!(server.json("/studies/town")["policy"]["memory_limit_mib"], 8192, "where it says nothing");
}

#[test]
fn what_a_manifest_is_merged_from_is_told_without_the_places_of_files() {
    let (server, _) = confined();
    let layered = format!("extends = \"layer.toml\"\n{}", study("town").replace("repeats = 3\n", ""));
    server.submit(&layered);
    let study = server.json("/studies/town");
    assert_eq!(study["policy"]["repeats"], 2, "{study}");
    let text = server.get("/studies/town/manifest").with(200).text();
    assert!(text.contains("layer.toml") && !text.contains(server.path().to_str().unwrap()), "{text}");
    // A mistake in the layer is told by its name, too.
    let wrong = layered.replace("layer.toml", "wrong.toml");
    std::fs::write(server.path().join("in/wrong.toml"), "[measure]\nrepeets = 2\n").unwrap();
    let problem = server.post("/studies", &json!({ "manifest": wrong })).problem(422);
    assert!(problem.to_string().contains("repeets"), "{problem}");
    assert!(!problem.to_string().contains(server.path().to_str().unwrap()), "{problem}");
}

#[test]
fn a_study_of_the_command_line_shows_no_place_of_its_files_when_it_is_run_again() {
    let folder = tempfile::tempdir().unwrap();
    furnish(folder.path());
    std::fs::create_dir(folder.path().join("in")).unwrap();
    let run = ["run", "town.toml", "--db", "x.db", "--no-report", "--set", "measure.repeats=1"];
    let out = super::server::cullmark(folder.path(), &run);
    assert!(out.status.success(), "{}", super::server::shown(&out));
    let server = Server::offering(folder, "in", &["--no-workers"]);
    assert_eq!(server.json("/studies/town")["runs"]["done"], RUNS);
    let here = server.path().canonicalize().unwrap();
    let problem = server.post("/studies/town/rerun", &json!({})).problem(422);
    assert!(problem["errors"][0]["message"].as_str().unwrap().contains("town.obj"), "{problem}");
    for place in [server.path(), &here] {
        assert!(!problem.to_string().contains(place.to_str().unwrap()), "{problem}");
    }
}

#[test]
fn an_upload_is_kept_under_its_hash_and_named_by_manifests() {
    let folder = tempfile::tempdir().unwrap();
    furnish(folder.path());
    std::fs::create_dir(folder.path().join("in")).unwrap();
    let server = Server::offering(folder, "in", &[]);
    let dir = server.path().join("uploads");
    let mesh = std::fs::read(server.path().join("town.obj")).unwrap();
    let sent = server.upload("scene", "my%20town%20(1).OBJ", &mesh).with(201).json();
    assert_eq!(
        (&sent["name"], &sent["kind"], &sent["triangles"]),
        (&json!("my town (1).OBJ"), &json!("scene"), &json!(16 * 12))
    );
    assert_eq!((&sent["bytes"], &sent["reference"]), (&json!(mesh.len()), &json!("upload:my town (1).OBJ")));
    let id = sent["id"].as_str().unwrap().to_string();
    assert_eq!(id, blake3::hash(&mesh).to_hex()[..32]);
    let path =
        server.upload("path", "walk.csv", &std::fs::read(server.path().join("walk.csv")).unwrap()).with(201).json();
    assert_eq!((&path["frames"], &path["triangles"]), (&json!(20), &Value::Null));
    // The same content again is one file, under its new name.
    server.upload("scene", "town.obj", &mesh).with(201);
    assert_eq!(server.json("/uploads")["items"].as_array().unwrap().len(), 2);
    let mut kept = names(&dir);
    kept.sort();
    let mut expected = vec![format!("{id}.obj"), format!("{}.csv", path["id"].as_str().unwrap())];
    expected.sort();
    assert_eq!(kept, expected);

    let by_name =
        study("town").replace("\"town.obj\"", "\"upload:town.obj\"").replace("\"walk.csv\"", "\"upload:walk.csv\"");
    let body = json!({ "manifest": by_name, "set": ["measure.repeats=1"] });
    server.post("/studies", &body).with(201);
    assert_eq!(server.finished("town")["runs"]["done"], RUNS);
    let by_id = by_name.replace("upload:town.obj", &format!("upload:{id}"));
    let plan =
        server.post("/studies", &json!({ "manifest": by_id, "set": ["measure.repeats=1"], "validate_only": true }));
    assert_eq!(plan.with(200).json()["plan"]["done"], RUNS, "the content counts, not its name");
    let problem =
        server.post("/studies", &json!({ "manifest": by_name.replace("upload:town", "upload:twon") })).problem(422);
    assert!(problem["errors"][0]["help"].as_str().unwrap().contains("upload:town.obj"), "{problem}");

    server.delete(&format!("/uploads/{id}")).with(204);
    server.delete(&format!("/uploads/{id}")).problem(404);
    server.get(&format!("/uploads/{id}/view")).problem(404);
    assert_eq!(names(&dir).len(), 1);
}

#[test]
fn a_run_whose_file_is_gone_fails_without_telling_where_it_was() {
    let server = Server::with(&["--no-workers"]);
    server.post("/studies", &json!({ "manifest": study("town"), "set": ["measure.repeats=1"] })).with(201);
    let (folder, _) = server.terminate();
    forget(folder.path(), "town.obj");
    let server = Server::within(folder, &[]);
    assert_eq!(server.finished("town")["runs"]["failed"], RUNS);
    let here = server.path().canonicalize().unwrap();
    for path in ["/studies/town/runs?columns=reason", "/studies/town/runs/0", "/studies/town/front"] {
        let text = server.get(path).with(200).text();
        assert!(text.contains("town.obj"), "{text}");
        assert!(!text.contains(here.to_str().unwrap()), "{path} tells where files lie: {text}");
    }
}

#[test]
fn names_that_are_no_plain_file_names_are_refused() {
    let server = Server::with(&["--no-workers"]);
    let mesh = std::fs::read(server.path().join("town.obj")).unwrap();
    let long = format!("{}.obj", "a".repeat(200));
    for name in
        ["..%2Fx.obj", ".hidden.obj", "a%2Fb.obj", "a%5Cb.obj", "%00.obj", "", &long, "a%0Ab.obj", "..", "a;b.obj"]
    {
        server.upload("scene", name, &mesh).problem(400);
    }
    for (kind, name) in
        [("scene", "town.txt"), ("scene", "town"), ("scene", "walk.csv"), ("path", "town.obj"), ("scene", "x.obj.exe")]
    {
        let problem = server.upload(kind, name, &mesh).problem(415);
        assert!(problem["help"].as_str().unwrap().contains("ends in ."), "{problem}");
    }
    server.upload("picture", "town.obj", &mesh).problem(400);
    assert_eq!((names(&server.path().join("uploads")), server.json("/uploads")["items"].clone()), (vec![], json!([])));
    assert!(!server.path().join("x.obj").exists());
}

#[test]
fn what_no_reader_understands_or_what_is_too_large_is_not_kept() {
    let server = Server::with(&["--no-workers", "--max-upload-mib", "1"]);
    let broken: &[(&str, &str, &[u8])] = &[
        ("scene", "a.obj", b"this is a letter"),
        ("scene", "b.obj", b"v 0 0 0\nf 1 2 3\n"),
        ("scene", "c.glb", b"glTF\x02\x00\x00\x00garbage"),
        ("scene", "d.gltf", b"{}"),
        ("scene", "e.gltf", br#"{"asset":{"version":"2.0"},"buffers":[{"uri":"../../x.db","byteLength":4}]}"#),
        ("scene", "f.obj", b"mtllib ../x.db\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
        ("path", "g.csv", b"frame,px\n0,1\n"),
        ("path", "h.csv", b"\xff\xfe\x00"),
    ];
    for (kind, name, bytes) in broken {
        let problem = server.upload(kind, name, bytes).problem(422);
        let text = problem.to_string();
        assert!(text.contains("cannot be read"), "{name}: {problem}");
        assert!(!text.contains(server.path().to_str().unwrap()), "{problem}");
        assert!(!text.contains("part-"), "{problem} names the file that is not kept");
    }
    server.upload("scene", "empty.obj", b"").problem(400);
    // Refused while it comes in; with and without a length that says so before.
    let big = vec![b'#'; 3 << 20];
    let head = format!(
        "POST /api/v1/uploads?kind=scene&name=big.obj HTTP/1.1\r\nHost: {}\r\nConnection: close\r\n",
        server.address
    );
    let told = [format!("{head}Content-Length: {}\r\n\r\n", big.len()).as_bytes(), &big].concat();
    let chunk = format!("{:x}\r\n", big.len());
    let chunked =
        [format!("{head}Transfer-Encoding: chunked\r\n\r\n{chunk}").as_bytes(), &big, b"\r\n0\r\n\r\n"].concat();
    for request in [told, chunked] {
        let reply = raw(&server.address, &request);
        assert_eq!((reply.status, reply.kind()), (413, "application/problem+json"), "{}", reply.text());
    }
    assert_eq!(server.json("/uploads")["items"], json!([]));
    assert_eq!(names(&server.path().join("uploads")), [""; 0], "nothing is left in the folder");
}
