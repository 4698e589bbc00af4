//! Chromium without a window, steered by its DevTools protocol over two pipes: JSON messages that end in
//! zero.
//!
//! The browser ends when the pipes close.

use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

/// Longest wait for anything, on a machine however busy.
const PATIENCE: Duration = Duration::from_secs(90);

/// A browser with one page that is checked, and one that checks its pictures.
pub struct Browser {
    child: Child,
    commands: Option<ChildStdin>,
    messages: Receiver<Value>,
    sent: u64,
    page: String,
    eye: String,
    loaded: bool,
    /// Errors, warnings and prints of the page.
    pub complaints: Vec<String>,
    /// The browser's own files.
    _profile: tempfile::TempDir,
}

impl Browser {
    /// Starts the browser that `RIGIDENT_BROWSER` names, or `chromium`.
    pub fn start() -> Self {
        let program = std::env::var("RIGIDENT_BROWSER").unwrap_or_else(|_| "chromium".to_owned());
        let profile = tempfile::tempdir().unwrap();
        // The browser reads commands from descriptor 3 and writes to 4.
        let mut child = Command::new("sh")
            .args(["-c", "exec \"$0\" \"$@\" 3<&0 4>&1 </dev/null >/dev/null 2>&1", &program])
            .args([
                "--headless",
                "--no-sandbox",
                "--disable-gpu",
                "--disable-dev-shm-usage",
                "--no-first-run",
            ])
            .args(["--remote-debugging-pipe", "--hide-scrollbars", "--disable-background-networking"])
            .args(["--disable-backgrounding-occluded-windows", "--disable-renderer-backgrounding"])
            .arg(format!("--user-data-dir={}", profile.path().display()))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let commands = child.stdin.take();
        let output = child.stdout.take().unwrap();
        let (send, messages) = channel();
        std::thread::spawn(move || {
            let parsed = BufReader::new(output).split(0).map_while(Result::ok);
            for message in parsed {
                if send.send(serde_json::from_slice(&message).unwrap()).is_err() {
                    break;
                }
            }
        });
        let (page, eye) = (String::new(), String::new());
        let mut browser = Self {
            child,
            commands,
            messages,
            sent: 0,
            page,
            eye,
            loaded: false,
            complaints: Vec::new(),
            _profile: profile,
        };
        browser.eye = browser.tab();
        browser.page = browser.tab();
        for domain in ["Page.enable", "Runtime.enable", "Log.enable"] {
            browser.call(domain, json!({}));
        }
        browser.call("Emulation.setFocusEmulationEnabled", json!({ "enabled": true }));
        browser
    }

    fn tab(&mut self) -> String {
        let target = self.call_in(None, "Target.createTarget", json!({ "url": "about:blank" }));
        let attach = json!({ "targetId": target["targetId"], "flatten": true });
        self.call_in(None, "Target.attachToTarget", attach)["sessionId"].as_str().unwrap().to_owned()
    }

    /// Sends a command to the page and returns its result.
    pub fn call(&mut self, method: &str, params: Value) -> Value {
        let page = self.page.clone();
        self.call_in(Some(&page), method, params)
    }

    fn call_in(&mut self, session: Option<&str>, method: &str, params: Value) -> Value {
        self.sent += 1;
        let mut message = json!({ "id": self.sent, "method": method, "params": params });
        if let Some(session) = session {
            message["sessionId"] = json!(session);
        }
        let commands = self.commands.as_mut().unwrap();
        commands.write_all(format!("{message}\0").as_bytes()).unwrap();
        commands.flush().unwrap();
        loop {
            let answer = self.message(method);
            if answer["id"] == self.sent {
                assert!(answer["error"].is_null(), "{method}: {answer}");
                return answer["result"].clone();
            }
        }
    }

    /// Takes the next message and notes what it tells of the page.
    fn message(&mut self, waiting_for: &str) -> Value {
        let message = self.messages.recv_timeout(PATIENCE).unwrap_or_else(|e| panic!("{waiting_for}: {e}"));
        match message["method"].as_str() {
            Some("Page.loadEventFired") => self.loaded = true,
            Some("Runtime.exceptionThrown" | "Runtime.consoleAPICalled" | "Log.entryAdded") => {
                self.complaints.push(message["params"].to_string());
            }
            _ => {}
        }
        message
    }

    /// Opens a file and waits until it is loaded.
    pub fn open(&mut self, file: &Path) {
        self.loaded = false;
        self.call("Page.navigate", json!({ "url": format!("file://{}", file.display()) }));
        while !self.loaded {
            self.message("loading");
        }
    }

    /// Sets the size of the window.
    pub fn resize(&mut self, width: u32, height: u32) {
        let size = json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": false });
        self.call("Emulation.setDeviceMetricsOverride", size);
    }

    /// Sets what the reader prefers: `prefers-color-scheme` and the like.
    pub fn prefer(&mut self, preferences: &[(&str, &str)]) {
        let features: Vec<Value> =
            preferences.iter().map(|(name, value)| json!({ "name": name, "value": value })).collect();
        self.call("Emulation.setEmulatedMedia", json!({ "features": features }));
    }

    /// Returns what an expression is in the page.
    pub fn value(&mut self, expression: &str) -> Value {
        let page = self.page.clone();
        self.value_in(&page, expression)
    }

    fn value_in(&mut self, session: &str, expression: &str) -> Value {
        let params = json!({ "expression": expression, "returnByValue": true, "awaitPromise": true });
        let answer = self.call_in(Some(session), "Runtime.evaluate", params);
        assert!(answer["exceptionDetails"].is_null(), "{expression}: {answer}");
        answer["result"]["value"].clone()
    }

    /// Returns a number of the page.
    pub fn number(&mut self, expression: &str) -> f64 {
        let value = self.value(expression);
        value.as_f64().unwrap_or_else(|| panic!("{expression} is {value}"))
    }

    /// Waits until an expression is true.
    pub fn wait(&mut self, condition: &str) {
        let begun = Instant::now();
        while self.value(condition) != true {
            assert!(begun.elapsed() < PATIENCE, "never: {condition}");
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    /// Waits until what was done is drawn.
    pub fn drawn(&mut self) {
        self.value(
            "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done(true))))",
        );
    }

    /// Returns the place of an element in the window, scrolled to: left, top, width, height.
    fn place(&mut self, selector: &str) -> [f64; 4] {
        let place = self.value(&format!(
            "(() => \
             {{ const e = document.querySelector({selector:?}); e.scrollIntoView({{block: 'center'}}); const b = e.getBoundingClientRect(); return [b.left, b.top, b.width, b.height]; }})()"
        ));
        std::array::from_fn(|k| place[k].as_f64().unwrap())
    }

    /// Returns a point of an element: shares of its width and height.
    pub fn point(&mut self, selector: &str, share: [f64; 2]) -> [f64; 2] {
        let [left, top, width, height] = self.place(selector);
        [left + share[0] * width, top + share[1] * height]
    }

    /// Does something with the left button of the mouse: `mousePressed`, `mouseMoved`, `mouseReleased`.
    pub fn mouse(&mut self, what: &str, [x, y]: [f64; 2]) {
        let params = json!({ "type": what, "x": x, "y": y, "button": "left", "buttons": 1, "clickCount": 1 });
        self.call("Input.dispatchMouseEvent", params);
    }

    /// Turns the wheel.
    pub fn wheel(&mut self, [x, y]: [f64; 2], delta: f64) {
        let params = json!({ "type": "mouseWheel", "x": x, "y": y, "deltaX": 0, "deltaY": delta });
        self.call("Input.dispatchMouseEvent", params);
    }

    /// Clicks in the middle of an element.
    pub fn click(&mut self, selector: &str) {
        let at = self.point(selector, [0.5, 0.5]);
        self.click_at(at);
    }

    /// Clicks somewhere.
    pub fn click_at(&mut self, at: [f64; 2]) {
        self.mouse("mousePressed", at);
        self.mouse("mouseReleased", at);
    }

    /// Drags from one place to another.
    pub fn drag(&mut self, from: [f64; 2], to: [f64; 2]) {
        self.mouse("mousePressed", from);
        for step in 1..=4 {
            let share = f64::from(step) / 4.0;
            self.mouse("mouseMoved", std::array::from_fn(|k| from[k] + share * (to[k] - from[k])));
        }
        self.mouse("mouseReleased", to);
    }

    /// Presses a key and lets it go.
    pub fn key(&mut self, key: &str, modifiers: u32) {
        let text = if key.chars().count() == 1 { key } else { "" };
        let code = match key {
            " " => 32,
            "Tab" => 9,
            "End" => 35,
            "Home" => 36,
            "ArrowLeft" => 37,
            "ArrowRight" => 39,
            _ => i32::from(key.to_uppercase().as_bytes()[0]),
        };
        for kind in ["keyDown", "keyUp"] {
            let params = json!({ "type": kind, "key": key, "text": text, "windowsVirtualKeyCode": code, "modifiers": modifiers });
            self.call("Input.dispatchKeyEvent", params);
        }
    }

    /// Keeps a picture of an element that is near the top of the page, as the screen shows it, under a name.
    pub fn picture(&mut self, name: &str, selector: &str) {
        self.mouse("mouseMoved", [1.0, 1.0]);
        self.value("scrollTo(0, 0)");
        self.drawn();
        let b = self.value(&format!("document.querySelector({selector:?}).getBoundingClientRect().toJSON()"));
        let clip =
            json!({ "x": b["x"], "y": b["y"], "width": b["width"], "height": b["height"], "scale": 1 });
        let picture = self.call("Page.captureScreenshot", json!({ "format": "png", "clip": clip }));
        let eye = self.eye.clone();
        self.value_in(
            &eye,
            &format!(
                "(async () => {{ const png = Uint8Array.from(atob({}), (c) => c.charCodeAt(0)); \
                 const i = await createImageBitmap(new Blob([png], {{ type: 'image/png' }})); \
                 const c = new OffscreenCanvas(i.width, i.height).getContext('2d'); c.drawImage(i, 0, 0); \
                 (globalThis.kept ??= {{}})[{name:?}] = c.getImageData(0, 0, i.width, i.height).data; }})()",
                picture["data"]
            ),
        );
    }

    /// Counts the pixels of a picture that are, in every channel within 4, of a colour.
    pub fn pixels_of(&mut self, name: &str, [r, g, b]: [u8; 3]) -> f64 {
        self.count(&format!(
            "(() => \
             {{ const p = kept[{name:?}]; let n = 0; for (let k = 0; k < p.length; k += 4) n += Math.abs(p[k] - {r}) < 5 && Math.abs(p[k+1] - {g}) < 5 && Math.abs(p[k+2] - {b}) < 5; return n; }})()"
        ))
    }

    /// Counts the colours of a picture.
    pub fn colours(&mut self, name: &str) -> f64 {
        self.count(&format!("new Set(new Uint32Array(kept[{name:?}].buffer)).size"))
    }

    /// Counts the pixels of which any channel differs by more than 12 between two pictures, all if their
    /// sizes do. Edges are not always smoothed in the same way.
    pub fn difference(&mut self, a: &str, b: &str) -> f64 {
        self.count(&format!(
            "(() => \
             {{ const [a, b] = [kept[{a:?}], kept[{b:?}]]; if (a.length !== b.length) return Math.max(a.length, b.length); const off = (k) => Math.abs(a[k] - b[k]) > 12; let n = 0; for (let k = 0; k < a.length; k += 4) n += off(k) || off(k + 1) || off(k + 2); return n; }})()"
        ))
    }

    fn count(&mut self, expression: &str) -> f64 {
        let eye = self.eye.clone();
        self.value_in(&eye, expression).as_f64().unwrap()
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        drop(self.commands.take());
        let begun = Instant::now();
        while begun.elapsed() < Duration::from_secs(10)
            && self.child.try_wait().is_ok_and(|ended| ended.is_none())
        {
            std::thread::sleep(Duration::from_millis(20));
        }
        // It has ended, or does not want to.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
