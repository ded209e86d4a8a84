#include "ingest/robot_session.h"

#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/json_number.h"
#include "base/utc_time.h"
#include "telemetry/validation.h"

namespace joulecast::ingest {
namespace {

constexpr std::int64_t clock_ahead_us = 10'000'000;      // more than transport and drift can cause
constexpr std::int64_t clock_tolerance_us = 1'000'000;   // of steered clocks
constexpr std::int64_t remember_charge_us = 10'000'000;  // by the robot's clock
constexpr std::int64_t report_contradiction_us = 3'600'000'000;
constexpr double least_measured = 0.5;  // of a mission's time, for forecasts to train on it

nlohmann::json json_of(const Contradiction& c) {
  return {{"kind", contradiction_kind_names[static_cast<std::size_t>(c.kind)]},
          {"id", c.id},
          {"channel", c.channel},
          {"value", json_number(c.value)},
          {"says", c.says}};
}

}  // namespace

RobotSession::RobotSession(const StoredRobot& stored, const SessionSettings& settings, SessionOutputs outputs)
    : robot_id_(stored.robot_id),
      settings_(settings),
      outputs_(std::move(outputs)),
      order_(settings.reorder_us, [this](const signals::Sample& sample) { place(sample); }),
      missions_(settings.mission),
      gaps_(settings.meter.gap_bridge_s),
      refinement_memory_(stored.refinement_memory),
      charge_memory_(stored.charge_memory),
      stored_contradictions_(stored.contradictions),
      event_allowance_(settings.event_rate_hz) {
  snapshot_.robot_id = robot_id_;
  if (stored.state) {
    snapshot_.state_of_charge = stored.state->state_of_charge;
    stored_charge_utime_us_ = stored.state->utime_us;
    stored_winding_temperature_c_ = stored.state->winding_temperature_c;
  }
  for (const Contradiction& c : stored_contradictions_)
    contradictions_told_[c.id + ' ' + c.channel] = c.told_utime_us;
  changed_ = true;
}

RobotSession::~RobotSession() = default;

void RobotSession::set_model(std::shared_ptr<const ModelInForce> model) {
  next_.reset();
  if (model == model_) return;
  if (model != nullptr && model_ != nullptr && open_ != nullptr && !open_->record.implicit) {
    next_ = std::move(model);
    return;
  }
  meter_with(std::move(model));
}

void RobotSession::meter_with(std::shared_ptr<const ModelInForce> model) {
  flush_meter();
  const signals::Accounts accounts = meter_ != nullptr ? meter_->accounts() : signals::Accounts{};
  model_ = std::move(model);
  meter_.reset();
  snapshot_.has_model = model_ != nullptr;
  snapshot_.model_version = model_ != nullptr ? model_->version : 0;
  if (model_ != nullptr) {
    legs_.emplace(model_->robot);
    meter_ = std::make_unique<energy::Meter>(model_->drive, settings_.meter,
                                             [this](const energy::MeterPoint& point) { on_point(point); });
    impossible_.emplace(model_->robot);
    contradictions_ = std::make_unique<ContradictionWatch>(model_->robot, model_->drive);
    if (!stored_contradictions_.empty()) {
      snapshot_.contradictions = stored_contradictions_;
      contradictions_->recall(std::exchange(stored_contradictions_, {}));
    }
    auto charge = std::make_unique<ChargeWatch>(model_->robot);
    if (charge_ != nullptr) {
      charge->take_over(*charge_);
    } else {
      charge->recall(charge_memory_);
      // Stored while the mission went on that turned out to be contradicted.
      if (!contradictions_->doubts_battery())
        charge->recall(stored_charge_utime_us_, snapshot_.state_of_charge);
    }
    charge_ = std::move(charge);
    if (refinement_ != nullptr) {
      refinement_->use(model_->robot, model_->version);
    } else {
      refinement_ = std::make_unique<RefinementWatch>(model_->robot, model_->version);
      refinement_->recall(refinement_memory_);
    }
    snapshot_.state_of_charge = charge_->estimate().charge;
    if (open_ != nullptr) {
      open_->use_another_meter(model_->version);
      meter_->resume(accounts.duration_s > 0 ? accounts : open_->record.accounts);
      contradictions_->begin_mission(open_->record.mission_id, open_->record.payload_kg);
    }
  }
  changed_ = true;
}

void RobotSession::resume(const StoredRobot& stored) {
  if (!stored.open) return;
  const history::Mission& mission = *stored.open;
  const std::vector<signals::Sample>& tail = stored.tail;
  if (!stored.model) {
    outputs_.warn(robot_id_, describe(stored.model.error()));
  } else if (const auto& earlier = *stored.model;
             earlier != nullptr && model_ != nullptr && earlier->version != model_->version) {
    next_ = model_;
    meter_with(earlier);
  }
  open_ = std::make_unique<OpenMission>(mission);
  covariates_.resume(mission);
  missions_.resume({mission.mission_id, mission.start_utime_us, mission.end_utime_us, mission.payload_kg,
                    mission.implicit});
  snapshot_.mission_id = mission.mission_id;
  snapshot_.mission_key = mission.key;
  snapshot_.mission_start_utime_us = mission.start_utime_us;
  snapshot_.mission_implicit = mission.implicit;
  snapshot_.accounts = mission.accounts;
  if (meter_ != nullptr) {
    meter_->resume(mission.accounts);
    contradictions_->begin_mission(mission.mission_id, mission.payload_kg);
  }
  for (const signals::Sample& sample : tail) (void)sequence_.place(sample.sequence, sample.utime_us);
  if (!tail.empty() && !taken_in_) order_.start_after(tail.back().sequence, tail.back().utime_us);
  if (!tail.empty() && meter_ != nullptr) meter_tail(tail);
  changed_ = true;
}

void RobotSession::take_over(const StoredRobot& stored,
                             const std::optional<history::StreamPosition>& position) {
  for (auto each = stored.ended.rbegin(); each != stored.ended.rend(); ++each) {
    const bool was_said = !each->implicit && (each->state == history::MissionState::finished ||
                                              each->state == history::MissionState::aborted);
    missions_.recall(
        {each->mission_id, each->start_utime_us, each->end_utime_us, each->payload_kg, each->implicit},
        was_said);
  }
  taken_in_ = position;
  if (position) {
    const auto& [utime_us, sequence] = *position;
    order_.start_after(sequence, utime_us);
    // The daemon that accounted for these samples has counted their faults.
    if (stored.tail.empty()) (void)sequence_.place(sequence, utime_us);
    last_sequence_ = sequence;
  }
  resume(stored);
  if (open_ == nullptr) return;
  open_->was_down = false;
  if (!open_->unmetered) open_->resumed_silent = false;
}

void RobotSession::meter_tail(std::span<const signals::Sample> tail) {
  open_->unmetered = false;
  meter_->resume(open_->record.accounts, open_->record.end_utime_us, stored_winding_temperature_c_);
  for (const signals::Sample& sample : tail) meter(sample);
}

void RobotSession::on_fault(IngestFault fault, std::uint64_t count, std::string why) {
  outputs_.counters.add(fault, count);
  note_fault(fault, count, std::move(why), snapshot_.received_utime_us);
}

void RobotSession::note_fault(IngestFault fault, std::uint64_t count, std::string why,
                              std::int64_t host_utime_us) {
  const std::string name = name_of(fault);
  snapshot_.faults[name] += count;
  if (open_ != nullptr) open_->record.sample_faults[name] += static_cast<std::int64_t>(count);
  changed_ = true;
  if (contradictions_ != nullptr) {
    const bool no_sample = fault == IngestFault::wrong_channel || fault == IngestFault::undecodable ||
                           fault == IngestFault::second_sender;
    if (no_sample) contradictions_->hear(count);
    // Of missing messages those count that come after some, not how many.
    contradictions_->hear(fault, fault == IngestFault::missing ? 1 : count, why);
  }
  if (why.empty()) return;
  if (const auto line = fault_log_.add(fault, count, why, host_utime_us)) outputs_.warn(robot_id_, *line);
  snapshot_.fault_notes[name] = std::move(why);
}

bool RobotSession::is_too_far_ahead(std::int64_t utime_us, std::int64_t host_utime_us) {
  const std::int64_t ahead_us = utime_us - host_utime_us;  // of plausible clocks: no overflow
  if (ahead_us <= settings_.max_ahead_us) return false;
  on_fault(
      IngestFault::too_far_ahead, 1,
      fmt::format("utime is {:.0f} s ahead of the service's clock; at most {:.0f} s are accepted",
                  static_cast<double>(ahead_us) * 1e-6, static_cast<double>(settings_.max_ahead_us) * 1e-6));
  return true;
}

void RobotSession::on_sample(const signals::Sample& sample, std::int64_t host_utime_us, std::int64_t one_of) {
  one_of_ = one_of;
  snapshot_.received_utime_us = host_utime_us;
  if (model_ == nullptr) return on_fault(IngestFault::unknown_robot);
  if (repeats_ && taken_in_ && sample.sequence <= taken_in_->sequence &&
      sample.utime_us <= taken_in_->utime_us)
    return;
  contradictions_->hear();
  if (const auto fault = telemetry::check_plausible(sample)) {
    if (sample.sequence > counted_) ++implausible_, counted_ = sample.sequence;
    return on_fault(IngestFault::implausible, 1, telemetry::describe(*fault));
  }
  if (is_too_far_ahead(sample.utime_us, host_utime_us)) return;
  if (sample.utime_us - host_utime_us > clock_ahead_us) on_fault(IngestFault::clock_ahead);
  snapshot_.clock_ahead_us = sample.utime_us - host_utime_us;
  if (!order_.take(sample, host_utime_us)) on_fault(IngestFault::duplicate);
  tell_contradictions(host_utime_us);
}

void RobotSession::tell_contradictions(std::int64_t now) {
  if (contradictions_ == nullptr || !contradictions_->take_changed()) return;
  changed_ = true;
  snapshot_.contradictions = contradictions_->all();
  for (Contradiction& c : snapshot_.contradictions) {
    const auto [told, first] = contradictions_told_.try_emplace(c.id + ' ' + c.channel, now);
    if (first || now - told->second >= report_contradiction_us || now < told->second) {
      told->second = now;
      outputs_.warn(robot_id_, "contradiction: " + c.says);
      ++outputs_.counters.contradictions[static_cast<std::size_t>(c.kind)];
      nlohmann::json detail = json_of(c);
      detail["mission"] =
          open_ != nullptr && open_->record.key > 0 ? nlohmann::json(open_->record.key) : nullptr;
      outputs_.post(history::AppendEvent{{0, now, robot_id_, "contradiction", json_text(detail)}});
    }
    c.told_utime_us = told->second;
  }
  if (contradictions_->doubts_battery()) restore_charge();
}

void RobotSession::restore_charge() {
  if (open_ == nullptr || open_->charge_memory.empty()) return;
  const std::string memory = std::exchange(open_->charge_memory, {});
  charge_ = std::make_unique<ChargeWatch>(model_->robot);
  charge_->recall(memory);
  snapshot_.state_of_charge = charge_->estimate().charge;
  remember_charge();
}

void RobotSession::interrupt() {
  release_held();
  charge_->interrupt();
  refinement_->interrupt();
  interrupt_meter();
}

void RobotSession::interrupt_meter() {
  flush_meter();
  meter_->interrupt();
  gaps_.reset();
}

void RobotSession::doubt_clock(const char* id, double value, std::string says) {
  contradictions_->doubt_mission({ContradictionKind::clock, id, "utime", value, std::move(says), true});
}

void RobotSession::on_sample_before_start(const signals::Sample& sample) {
  const std::int64_t before_us = open_->record.start_utime_us - sample.utime_us;
  if (before_us <= clock_tolerance_us) return;
  if (!open_->record.incomplete) open_->mark_incomplete("samples are stamped before the mission's start");
  const double before_s = 1e-6 * static_cast<double>(before_us);
  doubt_clock("samples_before_start", before_s,
              fmt::format("Samples are stamped {}, before the mission's start at {}, and are left out: "
                          "events and telemetry must be stamped by one clock, which is not set back.",
                          utc_text(sample.utime_us), utc_text(open_->record.start_utime_us)));
}

void RobotSession::on_clock_step(const signals::Sample& sample, std::int64_t elapsed_us) {
  interrupt();
  // A mission without samples began after the step.
  if (open_ != nullptr && open_->stored && std::abs(elapsed_us) > clock_tolerance_us) {
    const double step_s = 1e-6 * static_cast<double>(elapsed_us);
    doubt_clock(
        "clock_set", step_s,
        fmt::format("utime is set {} from {} to {} within the mission: the motion in between is unknown; "
                    "joulecast expects a clock that is only steered while the robot drives.",
                    step_s < 0 ? "back" : "forward", utc_text(sample.utime_us - elapsed_us),
                    utc_text(sample.utime_us)));
  }
  missions_.on_clock_step(sample.utime_us);
  covariates_.on_clock_step(sample.utime_us);
  if (open_ != nullptr) open_->on_clock_step(snapshot_.received_utime_us);
}

bool RobotSession::is_too_fast(std::int64_t elapsed_us) {
  const auto too_fast =
      open_ == nullptr ? std::nullopt
                       : open_->book(elapsed_us, snapshot_.received_utime_us, settings_.booked_margin_us);
  if (!too_fast) return false;
  interrupt();
  on_fault(
      IngestFault::too_fast, 1,
      fmt::format(
          "since the robot's clock was set, samples of {:.1f} s came in {:.1f} s; at most {:.0f} s more than "
          "passed are accounted for",
          static_cast<double>(too_fast->booked_us) * 1e-6, static_cast<double>(too_fast->passed_us) * 1e-6,
          static_cast<double>(settings_.booked_margin_us) * 1e-6));
  return true;
}

void RobotSession::place(const signals::Sample& sample) {
  const telemetry::Placement place = sequence_.place(sample.sequence, sample.utime_us);
  // What the daemon left out is counted as such.
  const std::int64_t refused = std::min(place.missing, implausible_),
                     thinned = std::min(place.missing - refused, (one_of_ - 1) * (refused + 1)),
                     missing = place.missing - refused - thinned;
  const bool begins =
      place.arrival == telemetry::Arrival::first || place.arrival == telemetry::Arrival::restart;
  implausible_ = begins ? 0 : implausible_ - refused;
  counted_ = begins ? sample.sequence : std::max(counted_, sample.sequence);
  if (thinned > 0)
    note_fault(IngestFault::queue_full, static_cast<std::uint64_t>(thinned), {}, snapshot_.received_utime_us);
  if (missing > 0) on_fault(IngestFault::missing, static_cast<std::uint64_t>(missing));
  if (place.arrival == telemetry::Arrival::duplicate) return on_fault(IngestFault::duplicate);
  if (place.arrival == telemetry::Arrival::late) return on_fault(IngestFault::late);
  if (place.arrival == telemetry::Arrival::restart) on_fault(IngestFault::restart);
  if (place.clock != telemetry::ClockStep::none) {
    // A mission that was not announced ends where the clock starts again.
    if (open_ != nullptr && open_->record.implicit && place.elapsed_us < -clock_tolerance_us) {
      interrupt();
      carry_out(missions_.on_restart());
    }
    // Between missions a robot may be silent for hours.
    const bool between = open_ == nullptr || !open_->stored;
    const bool backward = place.clock == telemetry::ClockStep::backward;
    if (!between)
      on_fault(backward ? IngestFault::clock_backward : IngestFault::clock_forward);
    else if (backward)
      outputs_.counters.add(IngestFault::clock_backward);
    on_clock_step(sample, place.elapsed_us);
  } else if (place.continues() &&
             1e-6 * static_cast<double>(place.elapsed_us) <= settings_.meter.gap_bridge_s &&
             is_too_fast(place.elapsed_us)) {
    return;
  }
  last_sequence_ = sample.sequence;

  const double modelled_power_w = open_ != nullptr ? snapshot_.modelled_power_w : signals::unmeasured;
  Received received{sample, sample};
  if (auto dropped = impossible_->drop(received.possible))
    on_fault(IngestFault::impossible, 1, std::move(dropped->why));
  if (telemetry::lacks_motion(received.possible)) return;
  signals::Sample trusted = received.possible;
  if (open_ == nullptr && held_.empty()) charge_before_ = charge_->memory_json();
  if (contradictions_->doubts_battery())
    trusted.battery_voltage_v = trusted.battery_current_a = signals::unmeasured;
  const ChargeWatch::Share share = charge_->add(trusted, modelled_power_w);
  snapshot_.state_of_charge = charge_->estimate().charge;
  changed_ = true;
  switch (share) {
    case ChargeWatch::Share::undecided:
      held_.push_back(received);
      break;
    case ChargeWatch::Share::charger:
      if (!at_charger_) {
        at_charger_ = true;
        interrupt_meter();
        refinement_->interrupt();
      }
      for (; !held_.empty(); held_.pop_front()) on_charger_sample(held_.front().sample);
      on_charger_sample(sample);
      break;
    case ChargeWatch::Share::robot:
      if (at_charger_) leave_charger();
      release_held();
      on_own_sample(received);
      break;
  }
  if (charge_->utime_us() - remembered_utime_us_ >= remember_charge_us) remember_charge();
}

void RobotSession::release_held() {
  while (!held_.empty()) {
    const Received received = held_.front();
    held_.pop_front();
    on_own_sample(received);
  }
}

// Power that flows while a charger feeds the robot is no cost of its motion: the sample is excluded from the
// mission's accounts, and does not open a mission.
void RobotSession::on_charger_sample(const signals::Sample& sample) {
  snapshot_.sample = sample;
  snapshot_.measured_power_w = sample.battery_voltage_v * sample.battery_current_a;
  snapshot_.modelled_power_w = signals::unmeasured;
  snapshot_.speed_m_s = snapshot_.yaw_rate_rad_s = 0;
  ++snapshot_.samples;
  ++outputs_.counters.samples;
  if (open_ == nullptr || open_->record.implicit) return;
  const telemetry::SampleStep step = missions_.on_sample(sample.utime_us, sample.payload_kg);
  carry_out(step.actions);
  if (!step.belongs || open_ == nullptr || open_->record.implicit) return;
  open_->resumed_silent = false;
  open_->end_at(sample.utime_us);
  ++open_->record.sample_faults["charging"];
  keep(sample);
}

// A sample outside all missions still shows the robot's present motion.
void RobotSession::show(const signals::Sample& sample) {
  snapshot_.sample = sample;
  snapshot_.measured_power_w = sample.battery_voltage_v * sample.battery_current_a;
  snapshot_.modelled_power_w = signals::unmeasured;
  const dynamics::Body<double> body =
      dynamics::body_of_wheels(model_->drive.parameters(), sample.wheel_velocity_rad_s, {});
  snapshot_.speed_m_s = body.speed_m_s;
  snapshot_.yaw_rate_rad_s = body.yaw_rate_rad_s;
}

void RobotSession::leave_charger() {
  at_charger_ = false;
  const std::optional<battery::ChargingStay> stay = charge_->take_ended();
  if (!stay) return;
  nlohmann::json detail{{"start_utime_us", stay->start_utime_us},
                        {"end_utime_us", stay->end_utime_us},
                        {"charged_ah", stay->charged_ah},
                        {"charged_j", stay->charged_j},
                        {"complete", stay->complete},
                        {"mission", nullptr}};
  detail["start_charge"] = json_number(stay->start_charge);
  detail["end_charge"] = json_number(charge_->estimate().charge);
  if (open_ != nullptr) detail["mission"] = open_->record.key;
  outputs_.post(history::AppendEvent{{0, snapshot_.received_utime_us, robot_id_, "charged", detail.dump()}});
  remember_charge();
}

bool RobotSession::teaches(const std::vector<Contradiction>& found) {
  history::Mission& record = open_->record;
  nlohmann::json untrue = nlohmann::json::array();
  for (const Contradiction& c : found)
    if (c.untrue) untrue.push_back(json_of(c));
  const signals::Accounts& a = record.accounts;
  const bool barely = a.measured_s > 0 && a.measured_s < least_measured * a.duration_s;
  if (untrue.empty() && !barely) return true;
  const auto why =
      static_cast<std::size_t>(untrue.empty() ? LeftOut::barely_measured : LeftOut::contradicted);
  ++snapshot_.missions_left_out[std::string(left_out_names[why])];
  ++outputs_.counters.missions_left_out[why];
  if (!untrue.empty())
    record.findings_json = json_text(nlohmann::json{{"contradictions", std::move(untrue)}});
  return false;
}

void RobotSession::judge_mission() {
  history::Mission& record = open_->record;
  if (outputs_.last_change) refinement_->set_change(outputs_.last_change(robot_id_));
  RefinementWatch::Judgement judged = refinement_->end_mission(record);
  if (judged.findings_json.empty()) return;
  contradictions_->doubt_missions(std::move(judged.payload_unit));
  tell_contradictions(snapshot_.received_utime_us);
  record.findings_json = std::move(judged.findings_json);
  if (!judged.payload_event_json.empty())
    outputs_.post(history::AppendEvent{{0, snapshot_.received_utime_us, robot_id_, "undeclared_payload",
                                        std::move(judged.payload_event_json)}});
  if (outputs_.suggest) {
    if (std::optional<history::Proposal> better = refinement_->suggestion()) {
      better->created_utime_us = snapshot_.received_utime_us;
      outputs_.suggest(std::move(*better));
    }
  }
  outputs_.post(history::PutLearned{
      {robot_id_, std::string(RefinementWatch::topic), record.end_utime_us, refinement_->memory_json()}});
}

void RobotSession::remember_charge() {
  if (charge_ == nullptr || charge_->utime_us() == 0) return;
  remembered_utime_us_ = charge_->utime_us();
  outputs_.post(history::PutLearned{
      {robot_id_, std::string(charge_topic), remembered_utime_us_, charge_->memory_json()}});
  // Outside missions the robot's position in the stream is stored as well.
  if (at_charger_ && open_ == nullptr && std::isfinite(snapshot_.state_of_charge))
    outputs_.post(history::PutResumeState{{robot_id_, snapshot_.sample.utime_us, last_sequence_,
                                           snapshot_.state_of_charge, snapshot_.winding_temperature_c}});
}

void RobotSession::keep(const signals::Sample& sample) {
  if (!open_->stored) begin_record();
  event_allowance_.earn_by_sample();
  open_->keep(sample);
  taken_in_ = {sample.utime_us, sample.sequence};
  if (open_->samples.size() >= settings_.checkpoint_samples) checkpoint();
}

void RobotSession::on_own_sample(const Received& received) {
  const signals::Sample& sample = received.sample;
  const telemetry::SampleStep step = missions_.on_sample(sample.utime_us, sample.payload_kg);
  carry_out(step.actions);
  if (!step.belongs || open_ == nullptr) {
    show(sample);
    if (open_ != nullptr) on_sample_before_start(sample);
    return on_fault(IngestFault::outside_mission);
  }

  if (open_->unmetered) open_->go_on_after_silence(sample.utime_us);
  open_->resumed_silent = false;
  ++snapshot_.samples;
  ++outputs_.counters.samples;
  if (open_->payload.contradicts(sample.payload_kg)) on_fault(IngestFault::zero_payload);
  meter(received.possible);
  keep(sample);  // as it came
  contradictions_->add(sample);
  changed_ = true;
}

void RobotSession::meter(const signals::Sample& sample) {
  gaps_.add(sample.utime_us, sample.sequence);
  undecided_.push_back(sample);
  undecided_.back().payload_kg = open_->payload.take(sample.payload_kg);
  meter_waiting(false);
}

void RobotSession::meter_waiting(bool ended) {
  while (const auto decided = gaps_.next(ended)) {
    const signals::Sample sample = undecided_.front();
    undecided_.pop_front();
    const bool bridged = decided->step == signals::Step::bridged;
    if (!bridged) refinement_->interrupt();
    const double climb_rad = covariates_.climb_at(model_->drive.parameters(), sample, decided->step);
    if (const Result<void> metered = meter_->add(sample, climb_rad, bridged); !metered) {
      on_fault(IngestFault::solver);
      outputs_.warn(robot_id_, describe(metered.error()));
    }
    refinement_->add(sample, climb_rad);
  }
}

bool RobotSession::may_send_event(std::int64_t host_utime_us) {
  if (event_allowance_.spend(host_utime_us)) return true;
  on_fault(IngestFault::event_flood, 1,
           fmt::format("more than {:g} mission events a second are ignored", settings_.event_rate_hz));
  return false;
}

void RobotSession::on_event(const signals::MissionEvent& event, std::int64_t host_utime_us) {
  snapshot_.received_utime_us = host_utime_us;
  if (model_ == nullptr) return on_fault(IngestFault::unknown_robot);
  if (const auto fault = telemetry::check_plausible(event)) {
    on_fault(IngestFault::implausible, 1, "mission event: " + telemetry::describe(*fault));
    if (fault->why == telemetry::Implausibility::bad_clock) return;
    signals::MissionEvent without_payload = event;
    without_payload.payload_kg = signals::unmeasured;
    return on_event(without_payload, host_utime_us);
  }
  if (is_too_far_ahead(event.utime_us, host_utime_us) || !may_send_event(host_utime_us)) return;
  take(event, false);
}

void RobotSession::recall(const MissionRequest& request) {
  snapshot_.mission_request_utime_us = request.request_utime_us;
  changed_ = true;
  if (request.event.phase != signals::MissionPhase::started) return;
  requested_.mission_id = request.event.mission_id;
  requested_.start_utime_us = request.event.utime_us;
}

void RobotSession::on_request(const MissionRequest& request) {
  if (model_ == nullptr || request.request_utime_us <= snapshot_.mission_request_utime_us) return;
  if (snapshot_.received_utime_us > 0) requested_utime_us_ = request.request_utime_us;
  take(request.event, true);
  recall(request);
}

std::string RobotSession::contradiction_of(const signals::MissionEvent& event, bool requested) const {
  if (open_ == nullptr || open_->record.implicit || open_->record.mission_id == event.mission_id) return {};
  const history::Mission& open = open_->record;
  const bool open_requested =
      open.mission_id == requested_.mission_id && open.start_utime_us == requested_.start_utime_us;
  if (open_requested == requested) return {};
  return fmt::format(
      "mission {} is {} while mission {} is open, which was {}; end that first, or begin and end missions "
      "either by the robot's events or over HTTP",
      event.mission_id, requested ? "requested over HTTP" : "announced by the robot", open.mission_id,
      requested ? "announced by the robot" : "requested over HTTP");
}

void RobotSession::take(const signals::MissionEvent& event, bool requested) {
  order_.flush();
  release_held();
  if (std::string why = contradiction_of(event, requested); !why.empty())
    return on_fault(IngestFault::bad_event, 1, std::move(why));
  // The sender knows how a mission ended that was open when the last daemon stopped.
  if (open_ != nullptr && open_->resumed_silent && open_->record.mission_id == event.mission_id &&
      event.phase != signals::MissionPhase::started)
    open_->go_on_after_silence(event.utime_us);
  const telemetry::MissionCounters before = missions_.counters();
  telemetry::MissionActions actions = missions_.on_event(event);
  if (actions.empty()) event_allowance_.give_back();  // robots may repeat themselves
  carry_out(actions);
  const telemetry::MissionCounters& after = missions_.counters();
  std::string why;
  if (after.unknown_missions > before.unknown_missions)
    why = "mission " + event.mission_id +
          " ends, and its start was not received: STARTED and FINISHED must name one mission_id";
  else if (after.out_of_order_events > before.out_of_order_events)
    why = "an event of mission " + event.mission_id +
          " is stamped before the start of the open mission, or after its own end";
  if (after.duplicate_events > before.duplicate_events && !repeats_) on_fault(IngestFault::duplicate);
  if (!why.empty() && !repeats_) on_fault(IngestFault::bad_event, 1, std::move(why));
  changed_ = true;
}

void RobotSession::on_covariates(const signals::CovariateMessage& message, std::int64_t host_utime_us) {
  if (const auto fault = telemetry::check_plausible(message))
    return on_fault(IngestFault::implausible, 1, "covariates: " + telemetry::describe(*fault));
  if (is_too_far_ahead(message.utime_us, host_utime_us)) return;
  const std::size_t before = covariates_.pending();
  covariates_.take(message, [this](IngestFault fault, std::string why) {
    if (!repeats_) on_fault(fault, 1, std::move(why));
  });
  snapshot_.map = covariates_.label_of("map");
  snapshot_.level = covariates_.label_of("level");
  outputs_.counters.covariate_changes += covariates_.pending() - before;
  if (open_ == nullptr || covariates_.pending() < settings_.checkpoint_samples) return;
  if (!open_->stored) begin_record();
  checkpoint();
}

void RobotSession::carry_out(const telemetry::MissionActions& actions) {
  for (const telemetry::MissionAction& action : actions)
    action.kind == telemetry::MissionAction::Kind::open ? open(action) : close(action);
}

void RobotSession::open(const telemetry::MissionAction& action) {
  if (action.implicit && !settings_.implicit_missions) return;
  flush_meter();
  meter_->begin();
  gaps_.reset();
  refinement_->begin_mission();
  trace_.begin();
  legs_->begin();
  covariates_.begin_mission(action.utime_us);
  contradictions_->begin_mission(action.mission_id, action.payload_kg);
  // The sample that opens an implicit mission is part of it.
  open_ = std::make_unique<OpenMission>(robot_id_, action, model_->version,
                                        action.implicit ? charge_before_ : charge_->memory_json());
  const history::Mission& record = open_->record;
  snapshot_.mission_id = record.mission_id;
  snapshot_.mission_key = 0;
  snapshot_.mission_start_utime_us = record.start_utime_us;
  snapshot_.mission_implicit = record.implicit;
  snapshot_.accounts = {};
}

void RobotSession::begin_record() {
  history::Mission& record = open_->record;
  open_->stored = true;
  const Result<history::MissionKey> key = outputs_.store.new_mission_key();
  if (!key) outputs_.warn(robot_id_, describe(key.error()));
  record.key = key.value_or(0);
  if (record.key > 0) outputs_.post(history::StartMission{record});
  snapshot_.mission_key = record.key;
  ++outputs_.counters.missions_started[record.implicit ? 1 : 0];
}

void RobotSession::close(const telemetry::MissionAction& action) {
  if (open_ == nullptr) return;
  flush_meter();
  history::Mission& record = open_->record;
  open_->finish(action);
  const std::vector<Contradiction> found =
      contradictions_ != nullptr ? contradictions_->end_mission() : std::vector<Contradiction>{};
  tell_contradictions(snapshot_.received_utime_us);
  if (open_->stored) {
    ++outputs_.counters.missions_ended[static_cast<std::size_t>(record.state)];
    if (meter_ != nullptr) open_->refresh(*meter_);
    const bool learn = teaches(found);
    if (learn) judge_mission();
    checkpoint();
    remember_charge();
    if (learn && outputs_.mission_ended && model_ != nullptr)
      outputs_.mission_ended(outputs_.post, model_, {record.start_utime_us, legs_->take()});
  } else {
    on_fault(IngestFault::empty_mission);
    (void)covariates_.settle(record);  // ends them; of an empty mission nothing is stored
  }
  open_.reset();
  if (charge_ != nullptr) charge_before_ = charge_->memory_json();
  covariates_.end_mission();
  snapshot_.mission_id.clear();
  snapshot_.mission_key = 0;
  changed_ = true;
  if (next_ != nullptr) meter_with(std::exchange(next_, nullptr));
}

void RobotSession::flush_meter(bool ended) {
  if (meter_ == nullptr) return;
  meter_waiting(ended);
  if (const Result<void> flushed = meter_->flush(); !flushed) {
    on_fault(IngestFault::solver);
    outputs_.warn(robot_id_, describe(flushed.error()));
  }
}

void RobotSession::checkpoint() {
  if (!open_->stored) return;
  if (meter_ != nullptr) open_->refresh(*meter_);
  history::CheckpointMission command;
  command.covariates = covariates_.settle(open_->record);
  command.mission = open_->record;
  command.trace = trace_.take();
  command.samples = std::exchange(open_->samples, {});
  command.position = taken_in_;
  open_->unsaved = 0;
  if (std::isfinite(snapshot_.state_of_charge))
    command.resume_state = history::ResumeState{robot_id_, snapshot_.sample.utime_us, last_sequence_,
                                                snapshot_.state_of_charge, snapshot_.winding_temperature_c};
  if (open_->record.key > 0) outputs_.post(std::move(command));
}

void RobotSession::on_point(const energy::MeterPoint& point) {
  const signals::Accounts& accounts = meter_->accounts();
  if (!point.bridged) on_fault(IngestFault::gap);
  trace_.add(point, accounts, snapshot_.state_of_charge);
  legs_->add({point.bridged ? point.interval_s : 0, point.speed_m_s, point.yaw_rate_rad_s,
              point.measured_power_w, point.sample.payload_kg, point.sample.velocity_command});
  if (open_ != nullptr) open_->end_at(point.sample.utime_us);
  snapshot_.sample = point.sample;
  snapshot_.measured_power_w = point.measured_power_w;
  snapshot_.modelled_power_w = point.modelled_power_w;
  snapshot_.speed_m_s = point.speed_m_s;
  snapshot_.yaw_rate_rad_s = point.yaw_rate_rad_s;
  snapshot_.winding_temperature_c = point.winding_temperature_c;
  snapshot_.drawn_j += accounts.drawn_j - snapshot_.accounts.drawn_j;
  snapshot_.returned_j += accounts.returned_j - snapshot_.accounts.returned_j;
  for (std::size_t k = 0; k < signals::term_count; ++k)
    snapshot_.ledger.value[k] += accounts.ledger.value[k] - snapshot_.accounts.ledger.value[k];
  snapshot_.accounts = accounts;
}

void RobotSession::on_tick(std::int64_t host_utime_us) {
  order_.release(host_utime_us);
  tell_contradictions(host_utime_us);
  if (snapshot_.received_utime_us > 0) {
    carry_out(
        missions_.on_silence(host_utime_us - std::max(snapshot_.received_utime_us, requested_utime_us_)));
  } else if (open_ != nullptr) {
    snapshot_.received_utime_us = host_utime_us;  // a resumed mission's silence counts from the restart
  }
  if (open_ != nullptr && (open_->unsaved > 0 || covariates_.pending() > 0)) checkpoint();
  publish();
}

void RobotSession::on_host_clock_step(std::int64_t host_utime_us, std::int64_t step_us) {
  if (requested_utime_us_ > 0) requested_utime_us_ += step_us;
  std::int64_t& received = snapshot_.received_utime_us;
  const auto distance = [host_utime_us](std::int64_t utime_us) { return std::abs(host_utime_us - utime_us); };
  // A message received after the step is stamped in the new time already.
  if (received == 0 || distance(received + step_us) >= distance(received)) return;
  received += step_us;
  changed_ = true;
}

void RobotSession::suspend() {
  order_.flush();
  release_held();
  flush_meter(false);
  hand_over();
}

void RobotSession::hand_over() {
  order_.flush();
  release_held();
  remember_charge();
  if (open_ != nullptr) checkpoint();
  publish();
}

void RobotSession::publish() {
  if (!changed_) return;
  changed_ = false;
  if (charge_ != nullptr) snapshot_.charge = charge_->view();
  outputs_.fleet.publish(std::make_shared<const RobotSnapshot>(snapshot_));
}

}  // namespace joulecast::ingest
