// The inner flight loop: from a position, velocity and yaw set point to rotor speeds, and a
// declared model in this loop.
//
// A cascade on the estimated state: position, velocity and integral to a thrust vector; its
// direction to body rates and torques; torques and thrust through the inverse of the rotor mixing.
//
// Of a declared model, each kind of effect enters in its own way. Wrench effects: their force and
// torque at the reference's velocity are taken off the rotors' share (`foresee`). Rotor-input
// effects: commands are found for the wanted delivered rotor speeds (`through_the_rotors`). Sensing
// effects: the filter has taken them out of its estimate already. Effects on the rigid body are
// mass, inertia and centre of mass of the flight loop. No effect is known here by its name.
#pragma once
#include "effects.hpp"

namespace windwrench {

constexpr double LEAST_THRUST = 0.3;    // of the weight
constexpr double SETPOINT_SPEED = 2.0;  // m/s, of a set point that commands accelerate
// s after which the rotors shall deliver what is wanted if the command were held so long. A lag tau
// is then led by 1 / (1 - exp(-HORIZON / tau)): 2.3 for 35 ms. A shorter one asks more of the
// motors and of the estimate's noise
constexpr double HORIZON = 0.02;
constexpr double PROBE = 1.02;  // of a rotor speed, at which its effect on the delivered is tried
// a delivered speed that changes less than this with its command is led no further: five times
constexpr double LEAST_SLOPE = 0.2;
constexpr double NO_SLOPE = 1e-3;  // what arrives only after the horizon cannot be led
constexpr int ROUNDS = 2;          // of Newton's method: one is exact for a linear lag

// what a command is: an acceleration beside the flight loop's own, of the set point, or one of the
// loop's lower stages
enum CommandKind { BESIDE, OF_SETPOINT, ATTITUDE, RATES, ROTOR_SPEEDS };

// of a set point: position m, velocity m/s, acceleration m/s2, yaw rad, yaw rate rad/s
enum { SET_VELOCITY = 3, SET_ACCELERATION = 6, SET_YAW = 9, SET_YAW_RATE = 10, SETPOINT = 11 };

// The flight loop's memory. `Flight<double>` is what Python sees as a NumPy record
// (controllers/flight.py); in lanes each vehicle has its own set point, sums and command
template <class T> struct Flight {
  using S = Single<T>;
  Body<S> body;
  S unmixing[4][4];  // thrust and torques to squared rotor speeds
  S omega_max, hover_rate;
  S position, velocity, integral, attitude, rate, yaw, yaw_rate, yaw_integral;  // gains
  S tilt_limit, leash;                                                          // rad, m
  T setpoint[SETPOINT];
  T sum[3], yaw_sum;  // integrals of the errors
  T rotation[3][3];   // estimated, body to world
  T command[4];       // rotor speeds, rad/s
  T foreseen[6];      // wrench of the model's effects: force world, torque body
  T wanted[4];        // rotor speeds to deliver, rad/s
};

// Move the set point with its own velocity for dt s; on an axis where it runs too far ahead of the
// vehicle's position (3) it waits
template <class T> void move_setpoint(Flight<T> &c, const T *position, Single<T> dt) {
  for (int i = 0; i < 3; i++) {
    T step = dt * c.setpoint[SET_VELOCITY + i], ahead = c.setpoint[i] + step - position[i];
    auto moves = (absolute(ahead) <= T{} + c.leash) | (ahead * step <= T{});
    c.setpoint[i] = choose(moves, c.setpoint[i] + step, c.setpoint[i]);
  }
  c.setpoint[SET_YAW] += dt * c.setpoint[SET_YAW_RATE];
}

// acceleration, m/s2, that the rotors must make along axis i of the world
template <class T> T wanted_acceleration(Flight<T> &c, const T *x, Single<T> dt, int i) {
  using S = Single<T>;
  const T *s = c.setpoint;
  T error = s[i] - x[i];
  c.sum[i] = within(c.sum[i] + dt * error, S(-2), S(2));
  T wanted = s[SET_ACCELERATION + i] + c.position * error +
             c.velocity * (s[SET_VELOCITY + i] - x[VELOCITY + i]) + c.integral * c.sum[i];
  return wanted - c.foreseen[i] / c.body.mass;  // the model's effects take their part
}

// The rotor speeds of a thrust in N and an angular acceleration (3) in rad/s2, body
template <class T> void turn(Flight<T> &c, const T *x, T thrust, const T *alpha) {
  const auto &J = c.body.inertia;
  T wx = x[RATE], wy = x[RATE + 1], wz = x[RATE + 2];
  T hx = row_times(J[0], wx, wy, wz), hy = row_times(J[1], wx, wy, wz),
    hz = row_times(J[2], wx, wy, wz);
  T tx = row_times(J[0], alpha[0], alpha[1], alpha[2]),
    ty = row_times(J[1], alpha[0], alpha[1], alpha[2]),
    tz = row_times(J[2], alpha[0], alpha[1], alpha[2]);
  // the thrust's torque about a declared centre of mass off the rotors' centre is balanced here
  tx = tx + wy * hz - wz * hy - c.foreseen[3] + c.body.com[1] * thrust;
  ty = ty + wz * hx - wx * hz - c.foreseen[4] - c.body.com[0] * thrust;
  tz = tz + wx * hy - wy * hx - c.foreseen[5];
  for (int i = 0; i < 4; i++) {
    const Single<T> *u = c.unmixing[i];
    T square = u[0] * thrust + u[1] * tx + u[2] * ty + u[3] * tz;
    c.command[i] = smaller(root(larger(square, T{})), T{} + c.omega_max);
  }
}

// Turn the body's z axis to a unit vector u (3) of the world, and the yaw to the set point's, at a
// thrust in N
template <class T> void point(Flight<T> &c, const T *x, Single<T> dt, T thrust, const T *u) {
  using S = Single<T>;
  const auto &R = c.rotation;
  // body z x wanted z, in the body frame: the turn that the thrust axis needs
  T bx = R[0][0] * u[0] + R[1][0] * u[1] + R[2][0] * u[2],
    by = R[0][1] * u[0] + R[1][1] * u[1] + R[2][1] * u[2];
  T error = c.setpoint[SET_YAW] - angle_of(R[1][0], R[0][0]);
  error = angle_of(sine(error), cosine(error));
  c.yaw_sum = within(c.yaw_sum + dt * error, S(-1), S(1));
  // the wanted yaw rate, a turn about the world's vertical, in the body frame
  T rate[3];
  for (int i = 0; i < 3; i++) rate[i] = R[2][i] * c.setpoint[SET_YAW_RATE];
  T alpha[3] = {-c.attitude * by - c.rate * (x[RATE] - rate[0]),
                c.attitude * bx - c.rate * (x[RATE + 1] - rate[1]),
                c.yaw * error + c.yaw_rate * (rate[2] - x[RATE + 2]) + c.yaw_integral * c.yaw_sum};
  turn(c, x, thrust, alpha);
}

// The rotor speeds that steer the estimated state x (20) to the set point, into c.command
template <class T> void fly(Flight<T> &c, const T *x, Single<T> dt) {
  using S = Single<T>;
  const auto &R = c.rotation;
  T a0 = wanted_acceleration(c, x, dt, 0), a1 = wanted_acceleration(c, x, dt, 1);
  T a2 = wanted_acceleration(c, x, dt, 2) + c.body.gravity;
  a2 = larger(a2, T{} + S(LEAST_THRUST) * c.body.gravity);
  T lateral = root(a0 * a0 + a1 * a1), limit = a2 * std::tan(c.tilt_limit), one = T{} + S(1);
  auto steep = lateral > limit;
  if (any(steep)) {
    T share = choose(steep, limit / choose(steep, lateral, one), one);
    a0 *= share;
    a1 *= share;
  }
  T thrust = c.body.mass * (a0 * R[0][2] + a1 * R[1][2] + a2 * R[2][2]);
  T length = root(a0 * a0 + a1 * a1 + a2 * a2);
  const T u[3] = {a0 / length, a1 / length, a2 / length};
  point(c, x, dt, thrust, u);
}

// Fly a commanded attitude: roll and pitch (rad), yaw rate (rad/s) and thrust (m/s2). Roll and
// pitch turn about the body's x and y axes at the present yaw, in the order yaw, pitch, roll.
// `move_setpoint` carries the set point's yaw along at the yaw rate
template <class T> void fly_attitude(Flight<T> &c, const T *x, const T *wanted, Single<T> dt) {
  c.setpoint[SET_YAW_RATE] = wanted[2];
  T yaw = angle_of(c.rotation[1][0], c.rotation[0][0]);
  T forward = sine(wanted[1]) * cosine(wanted[0]), right = sine(wanted[0]);
  const T u[3] = {cosine(yaw) * forward + sine(yaw) * right,
                  sine(yaw) * forward - cosine(yaw) * right, cosine(wanted[1]) * cosine(wanted[0])};
  point(c, x, dt, c.body.mass * wanted[3], u);
}

// Fly commanded angular velocities (rad/s, body) and thrust (m/s2)
template <class T> void fly_rates(Flight<T> &c, const T *x, const T *wanted) {
  const T alpha[3] = {c.rate * (wanted[0] - x[RATE]), c.rate * (wanted[1] - x[RATE + 1]),
                      c.yaw_rate * (wanted[2] - x[RATE + 2])};
  turn(c, x, c.body.mass * wanted[3], alpha);
}

// Fly a command (4) of a kind. BESIDE, OF_SETPOINT: m/s2, world, in the first three. ATTITUDE: as
// of `fly_attitude`. RATES: as of `fly_rates`. ROTOR_SPEEDS: rad/s
template <class T>
void steer(Flight<T> &c, const T *x, const T *command, CommandKind kind, Single<T> dt) {
  using S = Single<T>;
  matrix_of(x + QUATERNION, c.rotation);
  if (kind == ROTOR_SPEEDS) {
    for (int i = 0; i < 4; i++) c.command[i] = command[i];
  } else if (kind == RATES) {
    fly_rates(c, x, command);
  } else if (kind == ATTITUDE) {
    fly_attitude(c, x, command, dt);
  } else {
    for (int i = 0; i < 3; i++) {
      T &speed = c.setpoint[SET_VELOCITY + i];
      if (kind == OF_SETPOINT)
        speed = within(speed + dt * command[i], S(-SETPOINT_SPEED), S(SETPOINT_SPEED));
      c.setpoint[SET_ACCELERATION + i] += command[i];
    }
    fly(c, x, dt);
    for (int i = 0; i < 3; i++) c.setpoint[SET_ACCELERATION + i] -= command[i];
  }
}

// The wrench of the model's effects that the rotors have to balance, into c.foreseen.
//
// It is taken at the set point's position and velocity, without body rates. So does flatness-based
// control of vehicles with drag (Faessler, Franchi and Scaramuzza, RA-L 3(2), 2018). An effect's
// further part at the vehicle's own velocity is damping: a loop without this damping would
// oscillate more. Attitude: as estimated. Rotor speeds: as wanted last
template <class T> void foresee(Flight<T> &c, Model<T> &m, const T *x) {
  if (m.wrench_count == 0) return;
  matrix_of(x + QUATERNION, c.rotation);
  const T still[3] = {};
  FlightState<T> state = m.effect_state;  // with the rotors' acceleration
  fill_state(m, c.setpoint, c.rotation, c.setpoint + SET_VELOCITY, still, c.wanted, state);
  add_wrenches(m, state, c.foreseen);
}

// What the rotors deliver after the horizon at held commands (4), out (4); the model's own memory
// stays as it is
template <class T> void delivered(Model<T> &m, const T *commands, T *out) {
  Rotors<T> rotors = {{commands[0], commands[1], commands[2], commands[3]},
                      T{} + Single<T>(HORIZON),
                      m.voltage,
                      m.time};
  T memory[sizeof(m.memory[0]) / sizeof(T)];
  for (int i = 0; i < m.rotor_count; i++) {
    std::memcpy(memory, m.memory[i], sizeof(memory));
    m.rotor_models[i](m.rotor_coefficients[i], numbers_of<T>(m.constants), numbers_of<T>(rotors),
                      memory);
  }
  for (int i = 0; i < 4; i++) out[i] = rotors.speed[i];
}

// Turn c.command, the wanted rotor speeds (4) rad/s, into commands that deliver them
template <class T> void through_the_rotors(Flight<T> &c, Model<T> &m) {
  using S = Single<T>;
  for (int i = 0; i < 4; i++) c.wanted[i] = c.command[i];
  if (m.rotor_count == 0) return;
  for (int round = 0; round < ROUNDS; round++) {
    T now[4], then[4], probe[4];
    for (int i = 0; i < 4; i++) probe[i] = S(PROBE) * c.command[i] + S(1);
    delivered(m, c.command, now);
    delivered(m, probe, then);
    for (int i = 0; i < 4; i++) {
      T missing = c.wanted[i] - now[i], gained = then[i] - (c.wanted[i] - missing);
      T slope = gained / (probe[i] - c.command[i]);
      T led = c.command[i] + missing / larger(slope, T{} + S(LEAST_SLOPE));
      c.command[i] =
          choose(slope > T{} + S(NO_SLOPE), within(led, S(0), c.omega_max), c.command[i]);
    }
  }
}

}  // namespace windwrench
