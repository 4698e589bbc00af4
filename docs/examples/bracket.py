"""Makes bracket.csv: a 3.2 kg bracket shaken by hand on a load cell, 10 s at 100 Hz, Newton and Euler written out."""
import math, random
random.seed(17)
m, c = 3.2, (0.0, 0.01, 0.053)
I0 = (0.021, 0.017, 0.012, 0.0004, -0.0003, 0.0002)          # about the centre of mass: xx yy zz yz zx xy
p = (0.05, -0.02, 0.03)                                       # IMU
offset = (1.5, -0.8, 2.0, 0.05, -0.03, 0.02)
def cross(a, b): return (a[1]*b[2]-a[2]*b[1], a[2]*b[0]-a[0]*b[2], a[0]*b[1]-a[1]*b[0])
def add(*v): return tuple(map(sum, zip(*v)))
def mul(s, a): return tuple(s*x for x in a)
def tensor(t, v): return (t[0]*v[0]+t[5]*v[1]+t[4]*v[2], t[5]*v[0]+t[1]*v[1]+t[3]*v[2], t[4]*v[0]+t[3]*v[1]+t[2]*v[2])
cc = sum(x*x for x in c)
I = (I0[0]+m*(cc-c[0]**2), I0[1]+m*(cc-c[1]**2), I0[2]+m*(cc-c[2]**2), I0[3]-m*c[1]*c[2], I0[4]-m*c[2]*c[0], I0[5]-m*c[0]*c[1])
waves = [((0.5, 0.9, 0.0), (0.25, 2.1, 1.0)), ((0.45, 0.7, 0.6), (0.3, 1.7, 2.0)), ((0.8, 0.5, 1.2), (0.4, 1.4, 0.3))]
def angles(t):
    q, v = [], []
    for w in waves:
        q.append(sum(a*(math.sin(2*math.pi*f*t+h)-math.sin(h)) for a, f, h in w))
        v.append(sum(a*2*math.pi*f*math.cos(2*math.pi*f*t+h) for a, f, h in w))
    return q, v
def omega(t):                                                 # body rates of R = Rz Ry Rx
    (r, e, y), (dr, de, dy) = angles(t)
    return (dr-dy*math.sin(e), de*math.cos(r)+dy*math.cos(e)*math.sin(r), -de*math.sin(r)+dy*math.cos(e)*math.cos(r))
def state(t):
    h = 1e-4
    w = omega(t)
    dw = tuple((8*(a-b)-(d-g))/(12*h) for a, b, d, g in zip(omega(t+h), omega(t-h), omega(t+2*h), omega(t-2*h)))
    (r, e, y), _ = angles(t)
    acc = tuple(-a*(2*math.pi*f)**2*math.sin(2*math.pi*f*t+k) for a, f, k in ((0.03, 0.8, 0), (0.02, 1.1, 1), (0.03, 0.6, 2)))
    u = (acc[0], acc[1], acc[2]+9.80665)
    sr, cr, se, ce, sy, cy = math.sin(r), math.cos(r), math.sin(e), math.cos(e), math.sin(y), math.cos(y)
    R = ((cy*ce, cy*se*sr-sy*cr, cy*se*cr+sy*sr), (sy*ce, sy*se*sr+cy*cr, sy*se*cr-cy*sr), (-se, ce*sr, ce*cr))
    a = tuple(sum(R[i][k]*u[i] for i in range(3)) for k in range(3))
    return a, w, dw
g = random.gauss
print("t_s,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm,imu_ax_mps2,imu_ay_mps2,imu_az_mps2,imu_gx_radps,imu_gy_radps,imu_gz_radps")
for k in range(1001):
    t = k/100
    a, w, dw = state(t)
    F = mul(m, add(a, cross(dw, c), cross(w, cross(w, c))))
    M = add(tensor(I, dw), cross(w, tensor(I, w)), mul(m, cross(c, a)))
    ap = add(a, cross(dw, p), cross(w, cross(w, p)))
    row = [x+o+g(0, 0.1 if i < 3 else 0.005) for i, (x, o) in enumerate(zip(F+M, offset))]
    row += [x+g(0, 0.01) for x in ap]
    row += [x+g(0, 2e-4) for x in w]
    print(f"{t:.2f},"+",".join(f"{x:.4f}" for x in row[:3])+","+",".join(f"{x:.5f}" for x in row[3:6])+","+",".join(f"{x:.4f}" for x in row[6:9])+","+",".join(f"{x:.5f}" for x in row[9:]))
