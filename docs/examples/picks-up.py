"""Makes picks-up.csv: an arm of two joints on a force sensor picks up 0.4 kg and puts it down, 14.5 s at 60 Hz, momenta written out."""
import math, random
random.seed(5)
G, RATE, HOLDS = 9.80665, 60, (8.0, 11.5)
# What picks-up.urdf says: mass, centre of mass, its tensor there xx yy zz. Links: base, upper (about z), hand (about y).
base, upper, hand = ((2.0, (0, 0, 0.04), None), (1.5, (0.02, 0, 0.06), (0.004, 0.004, 0.003)), (0.8, (0.14, 0, 0), (0.0008, 0.006, 0.006)))
SHOULDER, ELBOW = (0, 0, 0.10), (0.03, 0, 0.12)
thing = (0.4, (0.30, 0, -0.03), (0.0002, 0.0002, 0.0002))
def cross(a, b): return (a[1]*b[2]-a[2]*b[1], a[2]*b[0]-a[0]*b[2], a[0]*b[1]-a[1]*b[0])
def add(*v): return tuple(map(sum, zip(*v)))
def mul(s, a): return tuple(s*x for x in a)
def yaw(q, v): return (math.cos(q)*v[0]-math.sin(q)*v[1], math.sin(q)*v[0]+math.cos(q)*v[1], v[2])
def pitch(q, v): return (math.cos(q)*v[0]+math.sin(q)*v[2], v[1], -math.sin(q)*v[0]+math.cos(q)*v[2])
waves = [((0.9, 0.31, 0.0), (0.35, 0.83, 1.0), (0.15, 1.37, 0.4)), ((0.5, 0.43, 2.0), (0.3, 0.97, 0.3), (0.12, 1.61, 1.2))]
def joints(t):
    at = [sum(a*math.sin(2*math.pi*f*t+h) for a, f, h in w) for w in waves]
    return at, [sum(a*2*math.pi*f*math.cos(2*math.pi*f*t+h) for a, f, h in w) for w in waves]
def momenta(t, holds):                                        # of all bodies, about the sensor; and mass times place
    (q, p), (dq, dp) = joints(t)
    turn = lambda v: yaw(q, pitch(p, v))
    w1 = (0, 0, dq)
    w2 = add(w1, yaw(q, (0, dp, 0)))
    elbow = add(SHOULDER, yaw(q, ELBOW))
    ve = cross(w1, yaw(q, ELBOW))
    P, L, S = (0, 0, 0), (0, 0, 0), mul(base[0], base[1])
    bodies = [(upper, SHOULDER, (0, 0, 0), w1, lambda v: yaw(q, v), lambda v: yaw(-q, v))]
    bodies += [(b, elbow, ve, w2, turn, lambda v: pitch(-p, yaw(-q, v))) for b in ([hand, thing] if holds else [hand])]
    for (m, c, I), origin, v0, w, to, back in bodies:
        r = to(c)
        place, mv = add(origin, r), mul(m, add(v0, cross(w, r)))
        own = to(tuple(i*x for i, x in zip(I, back(w))))
        P, L, S = add(P, mv), add(L, cross(place, mv), own), add(S, mul(m, place))
    return P, L, S, base[0]+sum(b[0][0] for b in bodies)
def change(k, t, holds, h=1e-3):
    a, b, d, g = (momenta(t+s*h, holds)[k] for s in (1, -1, 2, -2))
    return tuple((8*(x-y)-(u-v))/(12*h) for x, y, u, v in zip(a, b, d, g))
print("t_s,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm,shoulder_rad,elbow_rad")
for k in range(int(14.5*RATE)):
    t = k/RATE
    holds = HOLDS[0] <= t < HOLDS[1]
    _, _, S, M = momenta(t, holds)
    F = add(change(0, t, holds), (0, 0, M*G))
    T = add(change(1, t, holds), cross(S, (0, 0, G)))
    noisy = [x+random.gauss(0, 0.05) for x in F]+[x+random.gauss(0, 0.005) for x in T]
    turned = [x+random.gauss(0, 1e-4) for x in joints(t)[0]]
    print(f"{t:.4f},"+",".join(f"{x:.2f}" for x in noisy[:3])+","+",".join(f"{x:.3f}" for x in noisy[3:])+","+",".join(f"{x:.4f}" for x in turned))
