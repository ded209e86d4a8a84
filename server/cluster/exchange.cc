#include "server/cluster/exchange.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "base/try.h"
#include "ingest/snapshot_bytes.h"
#include "robot/robot_file.h"

namespace joulecast::server {
namespace {

constexpr std::uint64_t turns_between_learning = 4;

}  // namespace

Exchange::Exchange(std::string node, std::unique_ptr<history::SharedState> shared,
                   const history::Store& store, ingest::Keeping& keeping, ingest::FleetView& fleet,
                   ingest::ModelRegistry& models, ingest::Forecasts& forecasts,
                   std::function<std::int64_t()> now_utime_us,
                   std::function<void(const std::string&, const ingest::MissionRequest&)> request_mission)
    : node_(std::move(node)),
      shared_(std::move(shared)),
      store_(store),
      keeping_(keeping),
      fleet_(fleet),
      models_(models),
      forecasts_(forecasts),
      now_utime_us_(std::move(now_utime_us)),
      request_mission_(std::move(request_mission)) {}

Result<void> Exchange::turn() {
  Result<void> done = publish();
  if (done) done = hear();
  if (done) done = follow_models();
  if (done) done = follow_requests();
  if (done && turns_++ % turns_between_learning == 0) done = follow_learning();
  return done;
}

Result<void> Exchange::publish() {
  std::vector<history::LiveState> news;
  std::map<std::string, std::shared_ptr<const ingest::RobotSnapshot>> now;
  for (const auto& [robot_id, epoch] : keeping_.kept()) {
    auto snapshot = fleet_.find(robot_id);
    if (snapshot == nullptr) continue;
    const auto published = published_.find(robot_id);
    if (published == published_.end() || published->second != snapshot)
      news.push_back({robot_id, node_, epoch, ingest::snapshot_bytes(*snapshot)});
    now.emplace(robot_id, std::move(snapshot));
  }
  Result<void> put = shared_->put(news);
  if (put) published_ = std::move(now);
  return put;
}

Result<void> Exchange::hear() {
  TRY_ASSIGN(const auto news, shared_->news(node_));
  for (const history::LiveState& state : news) {
    if (keeping_.epoch_of(state.robot_id) != 0) continue;
    auto snapshot = ingest::snapshot_from_bytes(state.body);
    // Not in an earlier or later version's layout; under its own name.
    if (snapshot == nullptr || snapshot->robot_id != state.robot_id) continue;
    if (const std::int64_t now = now_utime_us_(); snapshot->received_utime_us > now) {
      auto received = std::make_shared<ingest::RobotSnapshot>(*snapshot);
      received->received_utime_us = now;  // the keeper's clock is ahead of this host's
      snapshot = std::move(received);
    }
    fleet_.publish(std::move(snapshot));
  }
  return {};
}

Result<void> Exchange::put_in_force(const std::string& robot_id, std::int64_t version) {
  TRY_ASSIGN(const auto stored, store_.model(robot_id, version));
  TRY_ASSIGN(robot::RobotModel robot, robot::parse_robot(stored.model_json));
  return models_.put(std::move(robot), version);
}

// A request to this daemon puts its model into the store and then in force. A model that was in force before
// the store was read and differs from the stored one was therefore changed by another daemon.
Result<void> Exchange::follow_models() {
  const auto version_of = [this](const std::string& robot_id) {
    const auto model = models_.find(robot_id);
    return model != nullptr ? std::optional(model->version) : std::nullopt;
  };
  std::map<std::string, std::optional<std::int64_t>> before;
  for (const auto& model : models_.all()) before.emplace(model->robot.robot_id, model->version);
  TRY_ASSIGN(auto stored, shared_->active_models());
  for (const auto& [robot_id, version] : before) stored.try_emplace(robot_id);  // removed with all of it
  for (const auto& [robot_id, version] : stored) {
    const std::optional<std::int64_t> own = before[robot_id];
    if (own == version || version_of(robot_id) != own) continue;
    if (version) {
      TRY(put_in_force(robot_id, *version));
    } else {
      models_.remove(robot_id);
      fleet_.remove(robot_id);
    }
  }
  return {};
}

Result<void> Exchange::follow_learning() {
  TRY_ASSIGN(auto read, shared_->learned(std::string(ingest::Forecasts::topic)));
  for (const auto& [robot_id, utime_us] : read) {
    const auto known = learned_.find(robot_id);
    if (known != learned_.end() && known->second != utime_us && keeping_.epoch_of(robot_id) == 0)
      forecasts_.learnt_elsewhere(robot_id);
  }
  learned_ = std::move(read);
  return {};
}

// A robot that is taken up later is given its requests by the pipeline, which ignores repeated ones.
Result<void> Exchange::follow_requests() {
  TRY_ASSIGN(const auto read, shared_->learned(std::string(ingest::mission_request_topic)));
  for (const auto& [robot_id, utime_us] : read) {
    std::int64_t& passed = requested_[robot_id];
    if (passed == utime_us || keeping_.epoch_of(robot_id) == 0) continue;
    TRY_ASSIGN(const auto requests, ingest::stored_mission_requests(store_, robot_id));
    for (const ingest::MissionRequest& request : requests) request_mission_(robot_id, request);
    passed = utime_us;
  }
  return {};
}

}  // namespace joulecast::server
