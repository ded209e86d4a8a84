#include "ingest/ingest_service.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "base/fault_boundary.h"
#include "base/try.h"
#include "signals/sample.h"

namespace joulecast::ingest {
namespace {

// Messages that come meanwhile are received with one wake-up. At 60,000 a second, with which the daemon's CPU
// time is 16.1 us a message at 0, 12.0 at 0.3, 13.0 at 1 and 11.2 at 3 ms.
constexpr std::chrono::milliseconds gather{1};
constexpr std::int64_t live_us = 5'000'000;  // a robot not received from for longer publishes no energy state

}  // namespace

IngestService::IngestService(IngestOptions options, const ModelRegistry& models, Forecasts& forecasts,
                             SessionOutputs outputs, Keeping* keeping)
    : options_(std::move(options)),
      models_(models),
      forecasts_(forecasts),
      outputs_(outputs),
      signatures_(options_.signatures),
      keeping_(keeping),
      pipeline_(options_.session, options_.max_unknown_robots, models, std::move(outputs), keeping) {}

IngestService::~IngestService() {
  stop();
}

Result<void> IngestService::start() {
  TRY(signatures_.read_keys());
  TRY(pipeline_.recover());
  TRY_ASSIGN(telemetry::LcmLink link, telemetry::LcmLink::open(options_.lcm_url));
  link_ = std::make_unique<telemetry::LcmLink>(std::move(link));
  const auto handler = [this](const telemetry::Received& received) {
    survive("receiving", [&] {
      std::optional<InboundMessage> message = decode_message(
          received.channel, received.data, host_utime_us(), outputs_.counters, received.sender, &signatures_);
      if (message) batch_.push_back(std::move(*message));
    });
  };
  TRY(link_->listen(handler, outputs_.counters.datagrams, options_.listen));
  running_ = true;
  receiving_ = true;
  pipeline_.start_reading();
  receiver_ = std::thread([this] { receive(); });
  accountant_ = std::thread([this] { account(); });
  return {};
}

void IngestService::stop() {
  if (!running_.exchange(false)) return;
  link_->wake();
  receiver_.join();
  {
    const std::lock_guard lock(mutex_);
    draining_ = true;
  }
  drains_.notify_one();
  accountant_.join();
}

void IngestService::request_mission(const std::string& robot_id, const MissionRequest& request) {
  const std::lock_guard lock(mutex_);
  queue_.push_back({robot_id, request, request.request_utime_us});
}

IngestStatus IngestService::status() const {
  IngestStatus s;
  {
    const std::lock_guard lock(mutex_);
    s.queue_messages = queue_.size();
    s.error = error_;
    s.key_error = key_error_;
  }
  s.receive_ticks = receive_ticks_;
  s.account_ticks = account_ticks_;
  s.receiving = receiving_;
  return s;
}

void IngestService::receive() {
  while (running_) {
    ++receive_ticks_;
    refresh_keys();
    const Result<int> handled = link_->poll(std::chrono::milliseconds(100));
    if (!handled) {
      receiving_ = false;
      {
        const std::lock_guard lock(mutex_);
        error_ = describe(handled.error());
      }
      outputs_.warn("", "LCM: " + describe(handled.error()));
      while (running_) {
        ++receive_ticks_;
        std::this_thread::sleep_for(std::chrono::milliseconds(100));
      }
      return;
    }
    if (batch_.empty()) continue;
    std::uint64_t dropped = batch_.size();
    {
      const std::lock_guard lock(mutex_);
      survive("receiving", [&] {
        for (InboundMessage& message : batch_) {
          message.one_of = thinning(queue_.size(), options_.queue_messages);
          if (queue_.size() >= options_.queue_messages || !is_chosen(message, message.one_of)) continue;
          queue_.push_back(std::move(message));
          --dropped;
        }
      });
    }
    batch_.clear();
    report_dropped(dropped);
    std::this_thread::sleep_for(gather);
  }
}

// Once a minute.
void IngestService::report_dropped(std::uint64_t dropped) {
  if (dropped == 0) return;
  outputs_.counters.add(IngestFault::queue_full, dropped);
  unreported_ += dropped;
  const auto now = Clock::now();
  if (now < next_report_) return;
  next_report_ = now + std::chrono::minutes(1);
  outputs_.warn(
      "", "accounting is slower than the robots send: " + std::to_string(std::exchange(unreported_, 0)) +
              " messages were left out, energy is integrated over longer steps");
}

void IngestService::refresh_keys() {
  const std::optional<Result<void>> read = signatures_.refresh();
  if (!read) return;
  if (!*read) outputs_.warn("", "the robots' keys stay as they were: " + describe(read->error()));
  const std::lock_guard lock(mutex_);
  key_error_ = *read ? "" : describe(read->error());
}

void IngestService::account() {
  std::vector<InboundMessage> work;
  std::vector<const InboundMessage*> ordered;
  auto next_publish = Clock::now(), next_tick = next_publish, next_energy = next_publish;
  for (bool last = false; !last;) {
    ++account_ticks_;
    {
      std::unique_lock lock(mutex_);
      drains_.wait_until(lock, next_publish, [&] { return draining_; });
      work.swap(queue_);
      last = draining_ && work.empty();
    }
    const auto now = Clock::now();
    next_publish = now + options_.publish_period;
    survive("accounting", [&] { pipeline_.follow_orders(); });
    // Robot by robot, as the states of hundreds of robots exceed the processor's caches.
    for (const InboundMessage& message : work) ordered.push_back(&message);
    std::ranges::stable_sort(
        ordered, {}, [](const InboundMessage* message) -> const std::string& { return message->robot_id; });
    for (const InboundMessage* message : ordered) survive("accounting", [&] { pipeline_.handle(*message); });
    ordered.clear();
    work.clear();
    if (const std::int64_t step_us = clock_steps_.take_step_us(); step_us != 0)
      survive("accounting", [&] { on_clock_step(step_us); });
    if (now >= next_tick) {
      next_tick = now + std::chrono::milliseconds(500);
      survive("accounting", [&] { pipeline_.tick(host_utime_us()); });
    }
    survive("accounting", [&] { pipeline_.publish(); });
    if (now >= next_energy) {
      next_energy = now + options_.energy_state_period;
      survive("accounting", [&] { publish_energy_states(); });
    }
  }
  survive("accounting", [&] { pipeline_.suspend(); });
}

void IngestService::on_clock_step(std::int64_t step_us) {
  const std::int64_t now_us = host_utime_us();
  const std::string step_s = std::to_string(static_cast<double>(step_us) * 1e-6);
  outputs_.warn("", "the host's clock was set by " + step_s + " s");
  outputs_.post(history::AppendEvent{{0, now_us, "", "host_clock_step", "{\"step_s\":" + step_s + "}"}});
  pipeline_.on_host_clock_step(now_us, step_us);
}

void IngestService::publish_energy_states() {
  const std::int64_t now = host_utime_us();
  for (const auto& snapshot : outputs_.fleet.all()) {
    if (keeping_ != nullptr && keeping_->epoch_of(snapshot->robot_id) == 0) continue;
    if (!snapshot->has_model || now - snapshot->received_utime_us > live_us || snapshot->sample.utime_us == 0)
      continue;
    const std::shared_ptr<const ModelInForce> model = models_.find(snapshot->robot_id);
    if (model == nullptr) continue;
    const forecast::Reach reach = forecasts_.live_reach(model, *snapshot);
    signals::EnergyState state;
    state.utime_us = snapshot->sample.utime_us;
    state.robot_id = snapshot->robot_id;
    state.mission_id = snapshot->mission_id;
    state.model_version = snapshot->model_version;
    state.measured_power_w = snapshot->measured_power_w;
    state.modelled_power_w = snapshot->modelled_power_w;
    if (snapshot->accounts.measured_s > 0) {
      state.measured_energy_j = snapshot->accounts.measured_j;
      state.unexplained_energy_j = snapshot->accounts.ledger[signals::Term::unexplained];
    }
    state.modelled_energy_j = snapshot->accounts.modelled_j;
    state.recovered_energy_j = snapshot->accounts.ledger[signals::Term::recovered];
    state.state_of_charge = snapshot->state_of_charge;
    state.state_of_charge_sd = snapshot->charge.estimate.sd;
    state.range_m = reach.range_m[1];
    state.range_band_m = {reach.range_m.front(), reach.range_m.back()};
    state.run_time_s = reach.run_time_s[1];
    state.run_time_band_s = {reach.run_time_s.front(), reach.run_time_s.back()};
    state.winding_temperature_c = snapshot->winding_temperature_c;
    const auto bytes = telemetry::encode_energy_state(state);
    if (!bytes) continue;
    const auto sent =
        link_->publish(telemetry::channel_of(telemetry::Subject::energy_state, snapshot->robot_id), *bytes);
    if (!sent) outputs_.warn(snapshot->robot_id, describe(sent.error()));
  }
}

}  // namespace joulecast::ingest
