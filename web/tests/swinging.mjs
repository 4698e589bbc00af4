// A recording by textbook formulas alone: a body on a load cell that is turned about a fixed point by two angles at a time.

const G = 9.80665;
/** The body: mass, kg; first moments, kg m; inertia about the load cell's origin, kg m². */
const M = 2.5;
const C = [0.03, -0.02, 0.08];
const I = [[0.045, 0.002, -0.004], [0.002, 0.052, 0.003], [-0.004, 0.003, 0.028]];
export const SWINGING = { m: M, mcx: M * C[0], mcy: M * C[1], mcz: M * C[2], Ixx: I[0][0], Iyy: I[1][1], Izz: I[2][2] };
export const SWINGING_RIG = "[recording]\nwrench_sign = \"on_body\"\n\n[load_cell]\nclass = \"0.1%\"\n\n[[imu]]\nposition_m = [0.0, 0.0, 0.0]\nrotation_wxyz = [1.0, 0.0, 0.0, 0.0]\n";

const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const times = (m, v) => m.map((row) => row.reduce((sum, x, k) => sum + x * v[k], 0));
const sum = (...all) => [0, 1, 2].map((k) => all.reduce((s, v) => s + v[k], 0));
const by = (s, v) => v.map((x) => s * x);

/** Roll, pitch and yaw, rad, of sums of sines that never repeat themselves. */
const angles = (t, w) => [0.5 * Math.sin(w * 5.1 * t) + 0.3 * Math.sin(w * 2.3 * t + 1), 0.45 * Math.sin(w * 4.3 * t + 0.4) + 0.3 * Math.sin(w * 1.7 * t), 0.6 * Math.sin(w * 6.1 * t + 2) + 0.3 * Math.sin(w * 3.1 * t)];

/** Angular rate in axes of the body, of the rates of the angles. */
function rate(t, w) {
  const h = 1e-5;
  const [a, b] = angles(t, w);
  const [da, db, dc] = angles(t + h, w).map((x, k) => (x - angles(t - h, w)[k]) / (2 * h));
  return [da - dc * Math.sin(b), db * Math.cos(a) + dc * Math.cos(b) * Math.sin(a), -db * Math.sin(a) + dc * Math.cos(b) * Math.cos(a)];
}

/** Noise that is the same in every run: sums of a linear congruence. */
function noises() {
  let seed = 12345;
  const uniform = () => (seed = (1103515245 * seed + 12345) % 2147483648) / 2147483648;
  return (sigma) => sigma * (uniform() + uniform() + uniform() + uniform() - 2) * Math.sqrt(3);
}

/** Rows as text, with noise: `seconds` at `hz`, the motion `faster` than usual by a factor. */
export function swinging(seconds, hz, faster = 1) {
  const noise = noises();
  const lines = ["t_s,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm,imu_ax_mps2,imu_ay_mps2,imu_az_mps2,imu_gx_radps,imu_gy_radps,imu_gz_radps"];
  for (let n = 0; n < seconds * hz; n++) {
    const t = n / hz;
    const [a, b] = angles(t, faster);
    // Specific force at rest: up, in axes of the body.
    const up = by(G, [-Math.sin(b), Math.sin(a) * Math.cos(b), Math.cos(a) * Math.cos(b)]);
    const w = rate(t, faster);
    const alpha = rate(t + 1e-3, faster).map((x, k) => (x - rate(t - 1e-3, faster)[k]) / 2e-3);
    const force = by(M, sum(up, cross(alpha, C), cross(w, cross(w, C))));
    const moment = sum(by(M, cross(C, up)), times(I, alpha), cross(w, times(I, w)));
    const cells = [...force.map((x) => (x + noise(0.05)).toFixed(4)), ...moment.map((x) => (x + noise(0.003)).toFixed(6)), ...up.map((x) => (x + noise(0.03)).toFixed(5)), ...w.map((x) => (x + noise(0.002)).toFixed(6))];
    lines.push([t.toFixed(6), ...cells].join(","));
  }
  return `${lines.join("\n")}\n`;
}

/** The same by two loggers: the IMU's with times of its own clock, by `clock` of the load cell's. */
export function twoLoggers(text, clock) {
  const rows = text.trim().split("\n").map((row) => row.split(","));
  const own = (cells, n) => (n === 0 ? cells[0] : clock(Number(cells[0])).toFixed(6));
  return {
    "force.csv": `${rows.map((cells) => cells.slice(0, 7).join(",")).join("\n")}\n`,
    "imu.csv": `${rows.map((cells, n) => [own(cells, n), ...cells.slice(7)].join(",")).join("\n")}\n`,
  };
}
