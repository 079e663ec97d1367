//! The server answers as its own OpenAPI document says: every route, every schema, every
//! kind of content, and errors in one shape.

use super::schema::differences;
use super::server::{Reply, shared};
use serde_json::{Value, json};
use std::collections::BTreeSet;

const METHODS: [&str; 5] = ["get", "post", "put", "patch", "delete"];

fn document() -> Value {
    shared().json("/openapi.json")
}

/// Every documented route: path, method, operation.
fn routes(document: &Value) -> Vec<(String, String, Value)> {
    let paths = document["paths"].as_object().unwrap();
    let of = |(path, item): (&String, &Value)| {
        let methods = METHODS.iter().filter_map(|m| Some((path.clone(), m.to_string(), item.get(*m)?.clone())));
        methods.collect::<Vec<_>>()
    };
    paths.iter().flat_map(of).collect()
}

/// A path with something that is there in the place of each parameter.
fn filled(path: &str) -> String {
    path.replace("{study}", "town@0")
        .replace("{run}", "1")
        .replace("{chart}", "total-time.svg")
        .replace("{frame}", "3")
        .replace("{id}", &shared().scene)
}

/// Nothing of it is there.
fn absent(path: &str) -> String {
    let fill = [("{study}", "nowhere"), ("{run}", "99"), ("{chart}", "none.svg"), ("{frame}", "9"), ("{id}", "0")];
    fill.iter().fold(path.to_string(), |p, (name, value)| p.replace(name, value))
}

/// The answer is of a kind that the operation lists for its status, and looks as its schema says.
fn conforms(document: &Value, operation: &Value, asked: &str, reply: &Reply) {
    let responses = &operation["responses"];
    let class = format!("{}XX", reply.status / 100);
    let response = [reply.status.to_string(), class].into_iter().find_map(|s| responses.get(&s));
    let response = response.unwrap_or_else(|| panic!("{asked}: {} is not documented", reply.status));
    if reply.body.is_empty() {
        assert!(response.get("content").is_none(), "{asked}: content is documented, none came");
        return;
    }
    let content = &response["content"][reply.kind()];
    assert!(content.is_object(), "{asked}: `{}` is not in {response}", reply.kind());
    if reply.kind().ends_with("json") {
        let found = differences(document, &content["schema"], &reply.json());
        assert!(found.is_empty(), "{asked}:\n{}\nin {}", found.join("\n"), reply.text());
    }
}

#[test]
fn every_reading_route_answers_as_documented() {
    let document = document();
    let reading: Vec<_> = routes(&document).into_iter().filter(|(_, m, _)| m == "get").collect();
    assert!(reading.len() >= 24, "{}", reading.len());
    // Parameters that are needed, and every other way to ask.
    let further: &[(&str, &[&str])] = &[
        ("/studies", &["limit=1"]),
        (
            "/studies/{study}/runs",
            &[
                "limit=2&sort=-total_cull_ms",
                "format=csv",
                "columns=octree.depth,reason,total_cull_ms",
                "where=depth=2",
            ],
        ),
        (
            "/studies/{study}/runs/{run}/series",
            &["trial=all", "trial=0", "format=csv", "format=arrow", "names=cull_ns"],
        ),
        ("/studies/{study}/matrix", &["metric=false_cull_ppm&where=culling=none"]),
        ("/studies/{study}/front", &["x=build_ms&y=mean_triangles&scene=town"]),
        ("/studies/{study}/runs/{run}/view/frames/{frame}", &["truth=true"]),
        ("/compare", &["first=town@0&second=town@1", "first=town@0&second=late&metric=mean_triangles"]),
    ];
    // Events never end, and only walks that draw occluders have a depth buffer.
    let ends = |p: &str| !p.ends_with("/events") && !p.ends_with("/depth");
    for (path, _, operation) in reading.iter().filter(|(p, ..)| ends(p)) {
        let more = further.iter().find(|(p, _)| p == path).map_or(&[][..], |(_, m)| m);
        let needed = operation["parameters"].as_array().into_iter().flatten();
        let bare = needed.filter(|p| p["in"] == "query" && p["required"] == true).count() == 0;
        for query in bare.then_some("").iter().chain(more) {
            let asked = format!("{}?{query}", filled(path)).trim_end_matches('?').to_string();
            let reply = shared().get(&asked).with(200);
            conforms(&document, operation, &asked, &reply);
        }
    }
    // Runs that failed or wait lack much of what the finished have.
    for (path, _, operation) in reading.iter().filter(|(p, ..)| p.starts_with("/studies/{study}")) {
        for (study, run) in [("late@0", "0"), ("held@0", "4")] {
            let asked = path.replace("{study}", study).replace("{run}", run);
            if !asked.contains('{') && !asked.contains("/view") && !asked.ends_with("/events") {
                conforms(&document, operation, &asked, &shared().get(&asked).with(200));
            }
        }
    }
}

#[test]
fn documented_parameters_are_those_of_the_path_and_those_that_are_understood_behind_it() {
    let document = document();
    let mut asked = 0;
    for (path, method, operation) in routes(&document) {
        let parameters = operation["parameters"].as_array().cloned().unwrap_or_default();
        let of = |place: &str| -> Vec<String> {
            let found = parameters.iter().filter(|p| p["in"] == place);
            found.map(|p| p["name"].as_str().unwrap().to_string()).collect()
        };
        let in_path: Vec<String> = path.split('{').skip(1).map(|p| p.split('}').next().unwrap().to_string()).collect();
        assert_eq!(of("path"), in_path, "{method} {path}");
        assert_eq!(of("path").len() + of("query").len(), parameters.len(), "{method} {path}: {parameters:?}");
        // Nonsense is refused for its value and never for its name. Nothing is changed by it.
        for name in of("query").iter().filter(|_| method == "get") {
            let reply = shared().get(&format!("{}?{name}=%00", filled(&path)));
            assert!(!reply.text().contains("unknown field"), "{path}?{name}: {}", reply.text());
            asked += 1;
        }
    }
    assert!(asked > 20, "{asked}");
}

#[test]
fn every_documented_route_is_there_and_says_what_is_not() {
    let document = document();
    for (path, method, operation) in routes(&document) {
        if path == "/studies" || path == "/uploads" || !path.contains('{') {
            continue;
        }
        let asked = absent(&path);
        let body = if method == "patch" { "{\"priority\": 1}" } else { "" };
        let kind = [("content-type", "application/json")];
        let reply = shared().send(&method.to_uppercase(), &format!("/api/v1{asked}"), &kind, body.as_bytes());
        conforms(&document, &operation, &asked, &reply);
        let problem = reply.problem(404);
        let said = problem["detail"].as_str().unwrap();
        assert!(!said.contains("/api/"), "{method} {asked} met the fallback: {problem}");
    }
    for path in ["/nothing", "/studies/town/nothing", "/"] {
        let problem = shared().get(path).problem(404);
        assert!(problem["help"].as_str().unwrap().contains("openapi.json"), "{problem}");
    }
}

#[test]
fn a_method_that_is_not_documented_is_a_405_problem() {
    let document = document();
    let known: BTreeSet<(String, String)> = routes(&document).into_iter().map(|(p, m, _)| (p, m)).collect();
    let paths: BTreeSet<&String> = known.iter().map(|(p, _)| p).collect();
    let mut asked = 0;
    for path in paths {
        for method in METHODS.iter().filter(|m| !known.contains(&(path.clone(), m.to_string()))) {
            let path = format!("/api/v1{}", filled(path));
            shared().send(&method.to_uppercase(), &path, &[], b"").problem(405);
            asked += 1;
        }
    }
    assert!(asked > 80, "{asked}");
    shared().send("DELETE", "/api/v1/openapi.json", &[], b"").problem(405);
}

#[test]
fn events_are_documented_as_the_stream_they_are() {
    let document = document();
    let operation = &document["paths"]["/studies/{study}/events"]["get"];
    assert!(operation["responses"]["200"]["content"]["text/event-stream"].is_object(), "{operation}");
    let mut heard = Vec::new();
    assert!(shared().events("town@0", |event, data| {
        heard.push((event.to_string(), data));
        event == "end"
    }));
    assert_eq!(heard[0].0, "progress");
    let summary = &json!({ "$ref": "#/components/schemas/Summary" });
    assert_eq!(differences(&document, summary, &heard[0].1), [""; 0]);
    assert_eq!(heard[0].1["running"], json!([]));
}

#[test]
fn mistakes_in_requests_are_named_and_show_no_path_of_the_server() {
    let document = document();
    let bad: &[(&str, &str, &str, u16, &str)] = &[
        ("GET", "/studies?limt=3", "", 400, "limt"),
        ("GET", "/studies?limit=0", "", 400, "limit"),
        ("GET", "/studies?limit=1001", "", 400, "limit"),
        ("GET", "/studies?limit=many", "", 400, "limit"),
        ("GET", "/studies?cursor=xyz", "", 400, "cursor"),
        ("GET", "/studies/town/runs?where=depht%20=%203", "", 400, "depht"),
        ("GET", "/studies/town/runs?where=depth%20=", "", 400, "where"),
        ("GET", "/studies/town/runs?sort=nothing", "", 400, "nothing"),
        ("GET", "/studies/town/runs?columns=nothing", "", 400, "nothing"),
        ("GET", "/studies/town/runs?cursor=%25%25", "", 400, "cursor"),
        ("GET", "/studies/town/runs?cursor=WzFd&sort=scene", "", 400, "cursor"),
        ("GET", "/studies/town/runs?format=xml", "", 400, "xml"),
        ("GET", "/studies/town/runs?colums=scene", "", 400, "colums"),
        ("GET", "/studies/town/matrix?metric=speed", "", 400, "speed"),
        ("GET", "/studies/town/front?x=speed", "", 400, "speed"),
        ("GET", "/studies/town/front?x=fps_mean_model", "", 400, "more of"),
        ("GET", "/studies/town/front?scene=moon", "", 400, "moon"),
        ("GET", "/studies/town/charts/none.svg", "", 404, "none"),
        ("GET", "/studies/town/charts/total-time.gif", "", 404, "total-time.gif"),
        ("GET", "/studies/town/runs/0/series?names=nothing", "", 400, "nothing"),
        ("GET", "/studies/town/runs/0/series?trial=first", "", 400, "first"),
        ("GET", "/studies/town/runs/0/view/frames/9999", "", 422, "9999"),
        ("GET", "/studies/town/runs/0/view/frames/many", "", 404, "many"),
        ("GET", "/studies/town/runs/0/view/frames/0/depth", "", 422, "draws no occluders"),
        ("GET", "/studies/late/runs/zero", "", 404, "zero"),
        ("GET", "/studies/town@9", "", 404, "town@9"),
        ("GET", "/compare?first=town", "", 400, "second"),
        ("GET", "/compare?first=town&second=moon", "", 404, "moon"),
        ("GET", "/compare?first=town&second=town&metric=speed", "", 400, "speed"),
        ("GET", "/uploads/0123/view", "", 404, "0123"),
        ("PATCH", "/studies/town", "{\"priority\": 101}", 400, "priority"),
        ("PATCH", "/studies/town", "{\"priorty\": 1}", 422, "priorty"),
        ("PATCH", "/studies/town", "{", 400, "JSON"),
        ("POST", "/studies", "{\"manifest\": \"\", \"sets\": []}", 400, "sets"),
        ("POST", "/studies", "{\"set\": []}", 400, "manifest"),
        ("POST", "/studies", "not json", 400, "body"),
        ("POST", "/studies", "{\"manifest\": \"\", \"priority\": -101}", 400, "priority"),
        ("POST", "/studies", "{\"manifest\": \"\", \"series\": true}", 400, "series"),
        ("POST", "/studies?priorty=1", "{\"manifest\": \"\"}", 400, "priorty"),
        ("POST", "/studies", "{\"manifest\": \"\"}", 422, "study"),
        ("DELETE", "/studies/moon?measurement=true", "", 400, "measurement"),
    ];
    for (method, path, body, status, names) in bad {
        let kind = [("content-type", "application/json")];
        let reply = shared().send(method, &format!("/api/v1{path}"), &kind, body.as_bytes());
        assert_eq!(reply.status, *status, "{method} {path} {body}: {}", reply.text());
        let problem_schema = &json!({ "$ref": "#/components/schemas/Problem" });
        assert_eq!(differences(&document, problem_schema, &reply.json()), [""; 0], "{method} {path}");
        let text = reply.text();
        let here = shared().dir.to_str().unwrap();
        let problem = reply.problem(*status);
        assert!(text.contains(names), "{method} {path} {body}: {problem}");
        assert!(!text.contains(here) && !text.contains("x.db"), "{problem} names a place of the server");
    }
    let toml = [("content-type", "text/plain")];
    shared().send("POST", "/api/v1/studies", &toml, b"[study]").problem(415);
}

#[test]
fn every_answer_carries_the_headers_that_protect_the_page() {
    for path in ["/", "/studies/town@0", "/healthz", "/metrics", "/api/v1/studies", "/api/v1/studies/nowhere", "/a.b"] {
        let reply = shared().send("GET", path, &[], b"");
        let header = |name: &str| reply.header(name).unwrap_or_else(|| panic!("{path} has no {name}")).to_string();
        assert_eq!(header("x-content-type-options"), "nosniff");
        assert_eq!(header("x-frame-options"), "DENY");
        assert_eq!(header("referrer-policy"), "no-referrer");
        let policy = header("content-security-policy");
        for part in ["default-src 'none'", "script-src 'self'", "frame-ancestors 'none'"] {
            assert!(policy.contains(part), "{path}: {policy}");
        }
        assert!(!policy.contains("unsafe"), "{path}: {policy}");
    }
    let page = shared().send("GET", "/studies/town@0", &[], b"").with(200);
    assert!(page.kind() == "text/html" && page.text().contains("<script"), "the page routes its views itself");
    let tag = page.header("etag").unwrap().to_string();
    let known = shared().send("GET", "/", &[("if-none-match", &tag)], b"");
    assert_eq!((known.status, known.body.len()), (304, 0));
    shared().send("GET", "/app/nothing.js", &[], b"").problem(404);
}
