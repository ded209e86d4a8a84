#include "client/virtual_robot/virtual_robot.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <utility>

namespace joulecast::virtual_robot {

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(World, slope_direction_rad, weak_side, stribeck_speed_m_s, stribeck_power,
                                   bristle_rad, brush_softness, motor_sensor_share, battery_sensor_share,
                                   emf_loss_share, thermal_time_constant_s, period_s, burst_time_s, patch_m)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(MissionTruth, mission_id, payload_kg, undeclared_kg, duration_s,
                                   distance_m, battery_energy_j)

namespace {

enum Stream : std::uint64_t { missions_stream, scatter_stream, sensors_stream, computer_stream };

constexpr double ambient_c = 24;
constexpr double usual_thermal_resistance_k_w =
    0.5;                                 // that the temperature sensor sees; R is the file's when warm
constexpr double exchange_below = 0.25;  // charge at which the pack is exchanged between missions
constexpr double scatter_friction = 0.025;
constexpr double scatter_viscous = 0.04;
constexpr double scatter_resistance = 0.008;
constexpr double scatter_idle = 0.010;
constexpr std::int64_t load_periods = 400;  // control periods after which the computer's load is another one
constexpr double load_pull = 0.1;           // back to one half
constexpr double load_step = 0.15;

}  // namespace

VirtualRobot::VirtualRobot(const SimulationSpec& spec, std::uint64_t seed)
    : spec_(spec),
      mission_rng_(Rng::stream(seed, missions_stream)),
      scatter_rng_(Rng::stream(seed, scatter_stream)),
      computer_rng_(Rng::stream(seed, computer_stream)),
      plant_(spec.robot, spec.imperfections, spec.world),
      pack_(spec.robot, spec.imperfections.battery_resistance, spec.initial_charge),
      controller_(spec.robot, spec.controller),
      pilot_(spec.robot, spec.smooth_ramps, spec.settle_s),
      sensors_(spec.sensors, spec.imperfections, spec.world, spec.robot, Rng::stream(seed, sensors_stream)) {
  steps_per_period_ = static_cast<int>(std::ceil(SpeedController::period_s / plant_.longest_step_s()));
  step_s_ = SpeedController::period_s / steps_per_period_;
  const double reach_m = spec_.script.map_half_width_m - spec_.script.clearance_m;
  planned_pose_ = {mission_rng_.uniform(-reach_m, reach_m), mission_rng_.uniform(-reach_m, reach_m),
                   mission_rng_.uniform(-3.1, 3.1)};
  plant_.state().x_m = planned_pose_.x_m;
  plant_.state().y_m = planned_pose_.y_m;
  plant_.state().heading_rad = planned_pose_.heading_rad;
  history_.fill(electrical());
}

std::optional<Emission> VirtualRobot::next() {
  while (outbox_.empty()) {
    if (!under_way_ && spec_.missions != 0 && missions_begun_ >= spec_.missions) return std::nullopt;
    run_period();
  }
  std::optional<Emission> next = std::move(outbox_.front());
  outbox_.pop_front();
  return next;
}

std::int64_t VirtualRobot::now_us() const {
  return spec_.start_utime_us + std::llround(1e6 * step_s_ * static_cast<double>(step_));
}

double VirtualRobot::sample_time_s(std::int64_t index) {
  double time_s = static_cast<double>(index) / spec_.rate_hz;
  if (spec_.sensors.sampling_jitter > 0)
    time_s += spec_.sensors.sampling_jitter * sensors_.rng().uniform(-1, 1) / spec_.rate_hz;
  return time_s;
}

void VirtualRobot::start_mission() {
  ++missions_begun_;
  under_way_ = true;
  if (missions_begun_ > 1 && spec_.charger.below <= 0 && pack_.state_of_charge() < exchange_below)
    pack_.exchange();
  MissionScatter scatter;
  const auto factor = [&](double deviation) { return 1 + spec_.scatter * deviation * scatter_rng_.normal(); };
  const double common = factor(scatter_friction);
  scatter.friction = {common * factor(scatter_friction / 2), common * factor(scatter_friction / 2)};
  scatter.viscous = factor(scatter_viscous);
  scatter.resistance = factor(scatter_resistance);
  scatter.idle_power = factor(scatter_idle);

  mission_ = {};
  mission_.start = planned_pose_;
  MissionScript script = plan_mission(spec_.robot, spec_.script, planned_pose_, mission_rng_);
  mission_.script = script;
  mission_.charge_at_start = pack_.state_of_charge();
  mission_.mission_id = spec_.robot.robot_id + (spec_.run.empty() ? "-m" : "-" + spec_.run + "-m") +
                        std::to_string(missions_begun_);
  mission_.payload_kg = script.payload_kg;
  mission_.undeclared_kg = script.undeclared_kg;
  mission_.scatter = scatter;
  accounts_at_start_ = plant_.accounts();
  plant_.begin_mission(script.payload_kg, script.undeclared_kg, scatter);
  plant_.set_winding_rise(spec_.imperfections.winding_temperature != 0 ? winding_rise_k_
                                                                       : std::array<double, 2>{});
  controller_.set_payload(script.payload_kg);
  pilot_.begin(std::move(script));
  outbox_.push_back(
      {now_us(), signals::MissionEvent{now_us(), mission_.mission_id, signals::MissionPhase::started,
                                       mission_.payload_kg, "virtual robot"}});
}

void VirtualRobot::finish_mission() {
  under_way_ = false;
  mission_.accounts = moved(plant_.accounts(), accounts_at_start_, -1);
  mission_.charge_at_end = pack_.state_of_charge();
  outbox_.push_back(
      {now_us(), signals::MissionEvent{now_us(), mission_.mission_id, signals::MissionPhase::finished,
                                       mission_.payload_kg, "virtual robot"}});
  finished_.push_back(mission_);
}

double VirtualRobot::load_power_w() const {
  double load_w = spec_.robot.idle_power_w * mission_.scatter.idle_power +
                  spec_.imperfections.accessory_load + plant_.outside_load_w();
  if (spec_.imperfections.x_sag_load != 0) {
    // The sag of the drives alone: the load's own sag would feed back on itself.
    const auto driven = pack_.terminals(plant_.bus_power_w(voltage_v_) + spec_.robot.idle_power_w);
    load_w += spec_.imperfections.x_sag_load * 100 * (1 - driven.voltage_v / pack_.open_circuit_voltage_v());
  }
  if (spec_.imperfections.x_cpu_load != 0) load_w += spec_.imperfections.x_cpu_load * cpu_load_;
  return load_w;
}

double VirtualRobot::battery_power_w() const {
  // A charger carries the robot's own loads besides.
  if (charging_)
    return pack_.charging_power_w(spec_.charger.rate_per_h * pack_.capacity_ah(), pack_.full_voltage_v());
  return plant_.bus_power_w(voltage_v_) + load_power_w();
}

bool VirtualRobot::wants_charging() const {
  return spec_.charger.below > 0 && pack_.state_of_charge() < spec_.charger.below;
}

// One control period at the charger.
void VirtualRobot::run_charger() {
  const double end_w = spec_.charger.end_per_h * pack_.capacity_ah() * pack_.full_voltage_v();
  if (rested_s_ == 0 && -battery_power_w() < end_w) charging_ = false;
  if (!charging_) rested_s_ += SpeedController::period_s;
  history_[static_cast<std::size_t>(period_) % history_length] = electrical();
  for (int k = 0; k < steps_per_period_; ++k) {
    take_what_is_due();
    ++step_;
  }
  pack_.advance(battery_power_w(), SpeedController::period_s);
  ++period_;
}

Electrical VirtualRobot::electrical() const {
  const auto battery = pack_.terminals(battery_power_w());
  return {voltage_v_, plant_.state().current_a, battery.voltage_v, battery.current_a};
}

// History holds the beginnings of past control periods; motor voltage is held from there on, the rest is
// nearly straight to the next.
Electrical VirtualRobot::delayed(double delay_s) const {
  const double now = static_cast<double>(step_) / steps_per_period_;  // in control periods
  const double at = std::max(0.0, now - delay_s / SpeedController::period_s);
  const auto index = static_cast<std::int64_t>(at);
  const auto begun = [&](std::int64_t k) { return history_[static_cast<std::size_t>(k) % history_length]; };
  const Electrical a = begun(index);
  const bool complete = index < period_;
  const Electrical b = complete ? begun(index + 1) : electrical();
  const double span = (complete ? static_cast<double>(index + 1) : now) - static_cast<double>(index);
  const double share = span > 0 ? (at - static_cast<double>(index)) / span : 0;
  const auto blend = [&](double x, double y) { return x + share * (y - x); };
  Electrical out;
  out.motor_voltage_v = a.motor_voltage_v;
  for (std::size_t s : {0u, 1u}) out.motor_current_a[s] = blend(a.motor_current_a[s], b.motor_current_a[s]);
  out.battery_voltage_v = blend(a.battery_voltage_v, b.battery_voltage_v);
  out.battery_current_a = blend(a.battery_current_a, b.battery_current_a);
  return out;
}

Reading VirtualRobot::reading() const {
  const double delay_s = spec_.imperfections.sensor_delay + spec_.latency_s;
  const PlantState& s = plant_.state();
  Reading r{delay_s > 0 ? delayed(delay_s) : electrical()};
  r.wheel_speed_rad_s = s.wheel_speed_rad_s;
  r.command = {command_.speed_m_s, command_.yaw_rate_rad_s};
  r.yaw_rate_rad_s = plant_.yaw_rate_rad_s();
  r.pitch_rad = plant_.climb_rad();
  r.pose = {s.x_m, s.y_m, s.heading_rad};
  r.winding_c = {ambient_c + winding_rise_k_[0], ambient_c + winding_rise_k_[1]};
  r.declared_payload_kg = pilot_.payload_kg();
  r.time_s = step_s_ * static_cast<double>(step_);
  return r;
}

void VirtualRobot::take_what_is_due() {
  const double now_s = step_s_ * static_cast<double>(step_);
  const double covariates_hz = spec_.sensors.covariates_hz;
  if (covariates_hz > 0 && now_s >= static_cast<double>(covariate_index_) / covariates_hz - 0.5 * step_s_)
    publish_covariates();
  if (now_s >= next_sample_s_ - 0.5 * step_s_) take_sample();
}

void VirtualRobot::publish_covariates() {
  const bool noise = spec_.sensors.noise;
  double height_m = plant_.height_m();
  if (noise) height_m += spec_.sensors.height_noise_m * computer_rng_.normal();
  outbox_.push_back(
      {now_us(), signals::CovariateMessage{now_us(),
                                           {{"cpu_load", cpu_load_},
                                            {std::string(signals::height_covariate),
                                             quantised(height_m, spec_.sensors.height_step_m)}}}});
  ++covariate_index_;
}

// Tasks come and go some times a minute.
void VirtualRobot::wander_load() {
  if (period_ % load_periods != 0) return;
  cpu_load_ += load_pull * (0.5 - cpu_load_) + load_step * computer_rng_.normal();
  cpu_load_ = std::clamp(cpu_load_, 0.0, 1.0);
}

void VirtualRobot::take_sample() {
  const Reading truth = reading();
  witness_ = {sensors_.systematic(truth), plant_.wheel_acceleration_rad_s2(voltage_v_)};
  signals::Sample sample = sensors_.sample(truth);
  sample.utime_us = now_us();
  sample.sequence = sample_index_;
  const bool lost =
      spec_.sensors.loss_probability > 0 && sensors_.rng().chance(spec_.sensors.loss_probability);
  if (!lost) outbox_.push_back({sample.utime_us, sample});
  ++sample_index_;
  next_sample_s_ = sample_time_s(sample_index_);
}

void VirtualRobot::run_period() {
  if (charging_ || rested_s_ > 0) {
    run_charger();
    if (rested_s_ < spec_.charger.rest_after_s) return;
    rested_s_ = 0;
    start_mission();
  }
  if (!under_way_) start_mission();
  const PlantState& s = plant_.state();
  const double payload_before_kg = pilot_.payload_kg();
  command_ = pilot_.update(s.x_m, s.y_m, s.heading_rad);
  if (pilot_.done()) {
    // The command is at rest and the leg before the end was a halt: the mission ends here.
    finish_mission();
    if (spec_.missions != 0 && missions_begun_ >= spec_.missions) return;
    if (wants_charging()) {
      charging_ = true;
      voltage_v_ = {};
      return;
    }
    start_mission();
    command_ = pilot_.update(s.x_m, s.y_m, s.heading_rad);
  } else if (pilot_.payload_kg() != payload_before_kg) {
    plant_.set_payload(pilot_.payload_kg());
    controller_.set_payload(pilot_.payload_kg());
  }

  const double encoder_step = spec_.sensors.encoder_step_rad_s;
  const Electrical before = electrical();
  voltage_v_ = controller_.update(
      command_,
      {quantised(s.wheel_speed_rad_s[0], encoder_step), quantised(s.wheel_speed_rad_s[1], encoder_step)},
      before.battery_voltage_v);

  wander_load();
  history_[static_cast<std::size_t>(period_) % history_length] = electrical();

  const double bus_before_j = plant_.accounts().bus;
  for (int k = 0; k < steps_per_period_; ++k) {
    take_what_is_due();
    plant_.advance(voltage_v_, step_s_);
    ++step_;
  }
  const double battery_w =
      (plant_.accounts().bus - bus_before_j) / SpeedController::period_s + load_power_w();
  pack_.advance(battery_w, SpeedController::period_s);

  const auto copper_w = plant_.copper_power_w();
  const double thermal_k_w = spec_.imperfections.winding_temperature != 0
                                 ? spec_.imperfections.winding_temperature
                                 : usual_thermal_resistance_k_w;
  const double share = -std::expm1(-SpeedController::period_s / spec_.world.thermal_time_constant_s);
  for (std::size_t side : {0u, 1u})
    winding_rise_k_[side] += share * (thermal_k_w * copper_w[side] - winding_rise_k_[side]);
  if (spec_.imperfections.winding_temperature != 0) plant_.set_winding_rise(winding_rise_k_);

  mission_.duration_s += SpeedController::period_s;
  mission_.distance_m += std::abs(plant_.speed_m_s()) * SpeedController::period_s;
  mission_.battery_energy_j += battery_w * SpeedController::period_s;
  ++period_;
}

std::string truth_json(const std::vector<Truth>& truths) {
  using Json = nlohmann::json;
  Json robots = Json::array();
  for (const Truth& truth : truths) {
    Json missions = Json::array();
    for (const MissionTruth& m : truth.missions) {
      const PlantAccounts& a = m.accounts;
      missions.push_back(m);
      missions.back().update({{"motor_energy_j", a.motor},
                              {"driver_energy_j", a.bus},
                              {"copper_j", a.copper},
                              {"brush_j", a.brush},
                              {"internal_friction_j", a.internal},
                              {"floor_friction_j", a.floor},
                              {"gear_j", a.gear},
                              {"drag_j", a.drag},
                              {"scrub_j", a.scrub},
                              {"slip_j", a.slip},
                              {"potential_j", a.potential}});
    }
    Json world = truth.world;
    world["zone"] = {truth.world.zone_x_m, truth.world.zone_y_m, truth.world.zone_radius_m};
    robots.push_back({{"robot_id", truth.robot_id},
                      {"seed", truth.seed},
                      {"effects", std::map(truth.effects.begin(), truth.effects.end())},
                      {"world", world},
                      {"missions", missions}});
  }
  return Json{{"robots", robots}}.dump(2) + "\n";
}

}  // namespace joulecast::virtual_robot
