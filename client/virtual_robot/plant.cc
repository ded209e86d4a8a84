#include "client/virtual_robot/plant.h"

#include <algorithm>
#include <numbers>

namespace joulecast::virtual_robot {
namespace {

constexpr double gravity_m_s2 = 9.80665;
constexpr double copper_per_kelvin = 0.00393;
constexpr double scrub_rate_rad_s = 0.02;          // yaw rate at which the tyres have built up their moment
constexpr double gear_speed_rad_s = 0.05;          // wheel speed at which mesh losses have built up
constexpr double turning_rad_s = 0.1;              // slowest yaw rate that counts as turning
constexpr double zone_edge_m = 0.10;               // width over which a wheel enters the zone
constexpr double shortest_electrical_s = 1e-4;     // a file without inductance still has some
constexpr std::array<double, 2> sides{1.0, -1.0};  // right turns the robot left

constexpr double branch_fraction = 0.25;  // of the ohmic resistance
constexpr double branch_time_s = 35;

// Over the nominal voltage; a blend of the flat middle of iron phosphate and the slope of lead.
const std::vector<std::pair<double, double>> relative_curve{{0.0, 0.84},  {0.05, 0.92}, {0.15, 0.965},
                                                            {0.35, 0.99}, {0.6, 1.01},  {0.8, 1.03},
                                                            {0.95, 1.05}, {1.0, 1.08}};

template <class T>
void move_weighted(T& state, const T& a, const T& b, const T& c, const T& d, double step_s) {
  state = moved(moved(moved(moved(state, a, step_s / 6), b, step_s / 3), c, step_s / 3), d, step_s / 6);
}

}  // namespace

struct Plant::Rates {
  PlantState state;
  PlantAccounts power;
};

Plant::Plant(const RobotParameters& robot, const Imperfections& imperfections, const World& world)
    : robot_(robot), effect_(imperfections), world_(world) {
  const double slip = effect_.wheel_slip;
  const double radius = robot_.wheel_radius_m * (1 + effect_.wheel_radius_error);
  arm_m_ = {radius * (1 + 0.5 * effect_.wheel_radius_asymmetry) * (1 - slip),
            radius * (1 - 0.5 * effect_.wheel_radius_asymmetry) * (1 - slip)};
  half_track_m_ = robot_.half_track_m * (1 + effect_.track_error);
  const double magnet_loss = effect_.torque_constant_loss;
  torque_per_a_ = robot_.torque_constant_nm_a * robot_.gear_ratio * (1 - magnet_loss);
  emf_per_rad_s_ =
      robot_.voltage_constant_v_s_rad * robot_.gear_ratio * (1 - world_.emf_loss_share * magnet_loss);
  inductance_h_ =
      std::max(robot_.inductance_h, shortest_electrical_s * robot_.resistance_ohm) + effect_.inductance;
  const double friction_mean_nm = 0.5 * (robot_.friction_torque_nm[0] + robot_.friction_torque_nm[1]);
  brush_scale_a_ = world_.brush_softness *
                   std::max(0.004 * robot_.current_limit_a, 0.1 * friction_mean_nm / torque_per_a_);
  bristle_ = {world_.bristle_rad, effect_.stribeck_friction,
              world_.stribeck_speed_m_s / robot_.wheel_radius_m, world_.stribeck_power};

  const double fastest_wheel_rad_s = 1.3 * robot_.speed_limit_m_s / robot_.wheel_radius_m;
  const double electrical_rate = (2 * robot_.resistance_ohm * (1 + std::max(0.0, effect_.resistance_error)) +
                                  std::abs(effect_.brush_drop) / brush_scale_a_) /
                                 inductance_h_;
  const double bristle_rate = fastest_wheel_rad_s / bristle_.bend_angle_rad;
  longest_step_s_ = std::min({5e-4, 2.2 / electrical_rate, 2.2 / bristle_rate});
  begin_mission(0, 0, {});
}

void Plant::begin_mission(double payload_kg, double undeclared_kg, const MissionScatter& scatter) {
  undeclared_kg_ = undeclared_kg;
  scatter_ = scatter;
  time_since_start_s_ = 0;
  for (std::size_t s : {0u, 1u}) {
    const double own = static_cast<std::size_t>(world_.weak_side) == s ? effect_.friction_asymmetry : 0;
    dry_nm_[s] = robot_.friction_torque_nm[s] * (1 + effect_.coulomb_friction + own) * scatter_.friction[s];
  }
  viscous_nm_s_rad_ = robot_.viscous_friction_nm_s_rad * (1 + effect_.viscous_friction) * scatter_.viscous;
  const double top_rad_s = robot_.speed_limit_m_s / robot_.wheel_radius_m;
  const double reference_nm = 0.5 * (robot_.friction_torque_nm[0] + robot_.friction_torque_nm[1]) +
                              robot_.viscous_friction_nm_s_rad * top_rad_s;
  cubic_nm_s3_rad3_ = effect_.x_speed_cubed * reference_nm / (top_rad_s * top_rad_s * top_rad_s);
  set_winding_rise({0, 0});
  set_payload(payload_kg);
}

void Plant::set_payload(double declared_kg) {
  payload_kg_ = declared_kg * (1 + effect_.payload_mass_error) + undeclared_kg_;
  update_inertia();
}

void Plant::set_winding_rise(const std::array<double, 2>& kelvin) {
  for (std::size_t s : {0u, 1u})
    resistance_ohm_[s] = robot_.resistance_ohm * (1 + effect_.resistance_error) * scatter_.resistance *
                         (1 + copper_per_kelvin * kelvin[s]);
}

void Plant::update_inertia() {
  const double chassis_kg = robot_.chassis_kg * (1 + effect_.chassis_mass_error);
  const double mass_kg = chassis_kg + 2 * robot_.wheel_kg + payload_kg_;
  weight_n_ = mass_kg * gravity_m_s2;
  inertial_mass_kg_ = mass_kg * (1 + effect_.linear_inertia_error);
  yaw_inertia_kg_m2_ = robot_.yaw_inertia_kg_m2 * (1 + effect_.yaw_inertia_error) +
                       robot_.payload_yaw_inertia_m2 * payload_kg_;
  coupling_kg_m_ = chassis_kg * (robot_.com_offset_m + effect_.com_offset);
  payload_floor_n_ = effect_.load_rolling_resistance * payload_kg_ * gravity_m_s2;
  payload_flex_n_s_m_ = effect_.x_payload_speed * payload_kg_ * gravity_m_s2 / robot_.speed_limit_m_s;

  // Kinetic energy with v = (a1 w1 + a2 w2)/2 and yaw rate = (a1 w1 - a2 w2)/(2 l) is half w' M w.
  const double sum = 0.25 * inertial_mass_kg_;
  const double difference = yaw_inertia_kg_m2_ / (4 * half_track_m_ * half_track_m_);
  const double m00 = (sum + difference) * arm_m_[0] * arm_m_[0] + robot_.wheel_inertia_kg_m2;
  const double m11 = (sum + difference) * arm_m_[1] * arm_m_[1] + robot_.wheel_inertia_kg_m2;
  const double m01 = (sum - difference) * arm_m_[0] * arm_m_[1];
  const double determinant = m00 * m11 - m01 * m01;
  inverse_inertia_ = {{{m11 / determinant, -m01 / determinant}, {-m01 / determinant, m00 / determinant}}};
}

double Plant::zone_share(double x_m, double y_m) const {
  const double inside_m = world_.zone_radius_m - std::hypot(x_m - world_.zone_x_m, y_m - world_.zone_y_m);
  return std::clamp(0.5 + inside_m / zone_edge_m, 0.0, 1.0);
}

double Plant::patch_share(double x_m, double y_m) const {
  const double k = std::numbers::pi / world_.patch_m;
  return 0.5 * (1 + std::sin(k * x_m) * std::sin(k * y_m));
}

// Of the hills, over the way along the heading.
double Plant::hill_rise(double x_m, double y_m, double heading_rad) const {
  const double k = 2 * std::numbers::pi / world_.hill_m;
  return effect_.grade * (std::cos(k * x_m) * std::cos(k * y_m) * std::cos(heading_rad) -
                          std::sin(k * x_m) * std::sin(k * y_m) * std::sin(heading_rad));
}

double Plant::climb_rad() const {
  const PlantState& s = state_;
  const double plane = std::sin(effect_.slope) * std::cos(s.heading_rad - world_.slope_direction_rad);
  return std::asin(plane + hill_rise(s.x_m, s.y_m, s.heading_rad));
}

double Plant::height_m() const {
  const PlantState& s = state_;
  const double k = 2 * std::numbers::pi / world_.hill_m, d = world_.slope_direction_rad;
  return std::sin(effect_.slope) * (s.x_m * std::cos(d) + s.y_m * std::sin(d)) +
         effect_.grade / k * std::sin(k * s.x_m) * std::cos(k * s.y_m);
}

// Two incommensurable periods, so that no clock predicts the spells.
bool Plant::brake_holds() const {
  const double turn = 2 * std::numbers::pi * time_s_ / world_.period_s;
  return std::sin(turn) + std::sin(std::numbers::sqrt2 * 1.7 * turn) > 0.3;
}

double Plant::driver_power_w(double motor_power_w) const {
  const double drawn = motor_power_w < 0 ? motor_power_w * (1 - effect_.no_regeneration) : motor_power_w;
  return drawn + effect_.driver_loss * std::abs(motor_power_w);
}

// Forces on the body, positive against forward motion and against a turn to the left, with their power.
Plant::Body Plant::body(const PlantState& s, double v, double yaw, PlantAccounts& power) const {
  const double drag_n = effect_.aerodynamic_drag * v * std::abs(v);
  double slope_n = effect_.slope == 0 ? 0
                                      : weight_n_ * std::sin(effect_.slope) *
                                            std::cos(s.heading_rad - world_.slope_direction_rad);
  if (effect_.grade != 0) slope_n += weight_n_ * hill_rise(s.x_m, s.y_m, s.heading_rad);
  const double scrub_nm =
      effect_.turning_scrub == 0
          ? 0
          : effect_.turning_scrub * weight_n_ * robot_.half_track_m / 2 * std::tanh(yaw / scrub_rate_rad_s);
  const double force_n = drag_n + slope_n - coupling_kg_m_ * yaw * yaw;
  const double moment_nm = scrub_nm + coupling_kg_m_ * v * yaw;
  power.drag = drag_n * v;
  power.potential = slope_n * v;
  power.scrub = scrub_nm * yaw;

  double floor_n = payload_floor_n_;
  if (effect_.floor_resistance_zone != 0)
    floor_n += effect_.floor_resistance_zone * weight_n_ * zone_share(s.x_m, s.y_m);
  if (effect_.x_floor_patches != 0)
    floor_n += effect_.x_floor_patches * weight_n_ * patch_share(s.x_m, s.y_m);
  floor_n += payload_flex_n_s_m_ * std::abs(v);
  double dry_factor = 1;
  if (effect_.x_cold_bearing != 0)
    dry_factor += effect_.x_cold_bearing * std::exp(-time_since_start_s_ / world_.burst_time_s);
  if (effect_.x_brake_drag != 0 && brake_holds()) dry_factor += effect_.x_brake_drag;
  return {force_n, moment_nm, floor_n, dry_factor};
}

Plant::Rates Plant::rates(const PlantState& s, const std::array<double, 2>& voltage_v) const {
  Rates out;
  PlantAccounts& power = out.power;
  const double rim0 = arm_m_[0] * s.wheel_speed_rad_s[0];
  const double rim1 = arm_m_[1] * s.wheel_speed_rad_s[1];
  const double v = 0.5 * (rim0 + rim1);
  const double yaw = (rim0 - rim1) / (2 * half_track_m_);
  out.state.x_m = v * std::cos(s.heading_rad);
  out.state.y_m = v * std::sin(s.heading_rad);
  out.state.heading_rad = yaw;
  out.state.wheel_angle_rad = s.wheel_speed_rad_s;
  const Body on = body(s, v, yaw, power);

  std::array<double, 2> net_nm{};
  for (std::size_t side : {0u, 1u}) {
    const double w = s.wheel_speed_rad_s[side];
    const double i = s.current_a[side];
    double dry_nm = dry_nm_[side] * on.dry_factor;
    if (effect_.x_cogging != 0) {
      const double angle = std::sin(1.5 * s.wheel_angle_rad[side]);
      dry_nm += dry_nm_[side] * effect_.x_cogging * angle * angle;
    }
    const double floor_nm = 0.5 * on.floor_n * arm_m_[side];
    const double bend_rate = bristle_.bend_rate(s.bend[side], w);
    const double ratio = Bristle::torque_ratio(s.bend[side], bend_rate, w);
    double internal_nm = dry_nm * ratio + viscous_nm_s_rad_ * w + cubic_nm_s3_rad3_ * w * w * w;
    if (effect_.x_cold_grease != 0)
      internal_nm += effect_.x_cold_grease * dry_nm_[side] * w * robot_.wheel_radius_m /
                     robot_.speed_limit_m_s * std::exp(-time_since_start_s_ / world_.burst_time_s);
    if (effect_.x_oval_wheel != 0)
      internal_nm += effect_.x_oval_wheel * dry_nm_[side] * std::sin(s.wheel_angle_rad[side]);

    // Torque that the gear transmits, after friction ahead: x = tau (1 + a) driving, tau (1 - a) braking.
    const double motor_nm = torque_per_a_ * i;
    double mesh_nm = 0;
    double slip_nm = 0;
    if (effect_.gear_efficiency != 0 || effect_.wheel_slip != 0) {
      const double passed_nm = motor_nm - internal_nm;
      const double direction = std::tanh(w / gear_speed_rad_s);
      const double a = effect_.gear_efficiency;
      mesh_nm = a * std::abs(passed_nm) / (passed_nm * w > 0 ? 1 + a : 1 - a) * direction;
      // A contact that slips while it drives turns part of the rim's force into heat.
      if (passed_nm * w > 0) slip_nm = std::abs(effect_.wheel_slip * passed_nm) * direction;
    }
    net_nm[side] = motor_nm - internal_nm - floor_nm * ratio - mesh_nm - slip_nm -
                   0.5 * arm_m_[side] * (on.force_n + sides[side] * on.moment_nm / half_track_m_);

    const double emf_v = emf_per_rad_s_ * w;
    const double brush_v = effect_.brush_drop == 0 ? 0 : effect_.brush_drop * std::tanh(i / brush_scale_a_);
    out.state.current_a[side] =
        (voltage_v[side] - resistance_ohm_[side] * i - emf_v - brush_v) / inductance_h_;
    out.state.bend[side] = bend_rate;

    const double electrical_w = voltage_v[side] * i;
    power.motor += electrical_w;
    power.bus += driver_power_w(electrical_w);
    power.copper += resistance_ohm_[side] * i * i;
    power.brush += brush_v * i;
    power.conversion += emf_v * i - motor_nm * w;
    power.internal += internal_nm * w;
    power.floor += floor_nm * ratio * w;
    power.gear += mesh_nm * w;
    power.slip += slip_nm * w;
  }
  out.state.wheel_speed_rad_s = {inverse_inertia_[0][0] * net_nm[0] + inverse_inertia_[0][1] * net_nm[1],
                                 inverse_inertia_[1][0] * net_nm[0] + inverse_inertia_[1][1] * net_nm[1]};
  return out;
}

void Plant::advance(const std::array<double, 2>& voltage_v, double step_s) {
  const Rates a = rates(state_, voltage_v);
  const Rates b = rates(moved(state_, a.state, step_s / 2), voltage_v);
  const Rates c = rates(moved(state_, b.state, step_s / 2), voltage_v);
  const Rates d = rates(moved(state_, c.state, step_s), voltage_v);
  move_weighted(state_, a.state, b.state, c.state, d.state, step_s);
  move_weighted(accounts_, a.power, b.power, c.power, d.power, step_s);
  time_since_start_s_ += step_s;
  time_s_ += step_s;
  warmth_w_ += (std::abs(motor_power_w(voltage_v)) - warmth_w_) * step_s / world_.burst_time_s;
}

double Plant::speed_m_s() const {
  return 0.5 * (arm_m_[0] * state_.wheel_speed_rad_s[0] + arm_m_[1] * state_.wheel_speed_rad_s[1]);
}

double Plant::yaw_rate_rad_s() const {
  return (arm_m_[0] * state_.wheel_speed_rad_s[0] - arm_m_[1] * state_.wheel_speed_rad_s[1]) /
         (2 * half_track_m_);
}

std::array<double, 2> Plant::wheel_acceleration_rad_s2(const std::array<double, 2>& voltage_v) const {
  return rates(state_, voltage_v).state.wheel_speed_rad_s;
}

double Plant::motor_power_w(const std::array<double, 2>& voltage_v) const {
  return voltage_v[0] * state_.current_a[0] + voltage_v[1] * state_.current_a[1];
}

double Plant::bus_power_w(const std::array<double, 2>& voltage_v) const {
  return driver_power_w(voltage_v[0] * state_.current_a[0]) +
         driver_power_w(voltage_v[1] * state_.current_a[1]);
}

double Plant::stored_energy_j() const {
  const double v = speed_m_s();
  const double yaw = yaw_rate_rad_s();
  double energy_j = 0.5 * inertial_mass_kg_ * v * v + 0.5 * yaw_inertia_kg_m2_ * yaw * yaw;
  for (std::size_t s : {0u, 1u}) {
    const double w = state_.wheel_speed_rad_s[s];
    energy_j += 0.5 * robot_.wheel_inertia_kg_m2 * w * w +
                0.5 * inductance_h_ * state_.current_a[s] * state_.current_a[s];
  }
  return energy_j;
}

std::array<double, 2> Plant::copper_power_w() const {
  return {resistance_ohm_[0] * state_.current_a[0] * state_.current_a[0],
          resistance_ohm_[1] * state_.current_a[1] * state_.current_a[1]};
}

double Plant::outside_load_w() const {
  double load_w = 0;
  if (effect_.x_radio_zone != 0) load_w += effect_.x_radio_zone * zone_share(state_.x_m, state_.y_m);
  if (effect_.x_periodic_load != 0 && std::fmod(time_since_start_s_, world_.period_s) < 0.5 * world_.period_s)
    load_w += effect_.x_periodic_load;
  if (effect_.x_start_burst != 0)
    load_w += effect_.x_start_burst * std::exp(-time_since_start_s_ / world_.burst_time_s);
  if (effect_.x_heading_load != 0)
    load_w += effect_.x_heading_load * 0.5 * (1 + std::cos(state_.heading_rad - world_.slope_direction_rad));
  if (std::abs(yaw_rate_rad_s()) > turning_rad_s) load_w += effect_.x_turn_lamp;
  return load_w + effect_.x_warm_fan * warmth_w_;
}

Pack::Pack(const RobotParameters& robot, double resistance_error, double state_of_charge)
    : curve_(robot.open_circuit_voltage),
      resistance_ohm_(robot.internal_resistance_ohm * (1 + resistance_error)),
      branch_resistance_ohm_(branch_fraction * resistance_ohm_),
      capacity_c_(3600 * robot.capacity_ah),
      charge_(state_of_charge) {
  if (curve_.empty()) {
    curve_ = relative_curve;
    for (auto& point : curve_) point.second *= robot.nominal_voltage_v;
  }
}

double Pack::open_circuit_voltage_v() const {
  const auto above =
      std::find_if(curve_.begin(), curve_.end(), [&](const auto& point) { return point.first >= charge_; });
  if (above == curve_.begin()) return curve_.front().second;
  if (above == curve_.end()) return curve_.back().second;
  const auto below = above - 1;
  const double share = (charge_ - below->first) / (above->first - below->first);
  return below->second + share * (above->second - below->second);
}

Pack::Terminals Pack::terminals(double power_w) const {
  const double source_v = open_circuit_voltage_v() - branch_v_;
  // power = (source - R i) i; the smaller root, written so that R = 0 is no special case.
  const double root = std::sqrt(std::max(0.0, source_v * source_v - 4 * resistance_ohm_ * power_w));
  const double current_a = 2 * power_w / (source_v + root);
  return {source_v - resistance_ohm_ * current_a, current_a};
}

double Pack::charging_power_w(double most_current_a, double most_voltage_v) const {
  const double source_v = open_circuit_voltage_v() - branch_v_;
  const double resistance_ohm = std::max(resistance_ohm_, 1e-6);
  const double current_a = std::clamp((most_voltage_v - source_v) / resistance_ohm, 0.0, most_current_a);
  return -current_a * (source_v + resistance_ohm_ * current_a);
}

void Pack::advance(double power_w, double step_s) {
  const double current_a = terminals(power_w).current_a;
  charge_ = std::clamp(charge_ - current_a * step_s / capacity_c_, 0.0, 1.0);
  branch_v_ += (branch_resistance_ohm_ * current_a - branch_v_) * -std::expm1(-step_s / branch_time_s);
}

}  // namespace joulecast::virtual_robot
