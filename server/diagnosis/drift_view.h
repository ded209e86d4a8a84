#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "base/error.h"
#include "drift/marks.h"
#include "drift/siblings.h"
#include "history/store.h"
#include "history/writer.h"
#include "ingest/model_registry.h"

namespace joulecast::server {

struct DriftOptions {
  drift::Settings settings;
  std::size_t max_missions = 500;  // of each robot, newest first
};

// Robots with a changed consumption, from the store's missions: one answer for the watch, the page, diagnoses
// and adoption. Safe to use from any thread.
class DriftView {
 public:
  DriftView(const history::Store& store, const ingest::ModelRegistry& models, const DriftOptions& options)
      : store_(store), models_(models), options_(options) {}

  // The finished missions of a robot that measured energy and may be learnt from, as the meter accounted
  // them, newest `limit`, oldest first.
  Result<std::vector<drift::MissionRatio>> missions(const std::string& robot_id, std::size_t limit) const;

  // Where its ratio changed, oldest first.
  Result<std::vector<drift::Mark>> marks(const std::string& robot_id) const;

  // Start of the first mission after its last change, when that came under this version of its model.
  Result<std::optional<std::int64_t>> last_change(const std::string& robot_id, std::int64_t version) const;

  // Its newest missions under the model in force.
  Result<std::vector<drift::MissionRatio>> recent(const ingest::ModelInForce& model) const;

  // Robots of its kind (robot/robot_fields.h), itself among them, that have enough missions, compared by
  // their recent() ones; none where the robot has no model.
  Result<std::vector<drift::SiblingRatio>> siblings(const std::string& robot_id) const;
  // The comparison of robots of one kind by their recent() missions.
  std::vector<drift::SiblingRatio> compare(const std::vector<drift::RobotRatios>& kind) const {
    return drift::compare_siblings(kind, options_.settings);
  }

 private:
  const history::Store& store_;
  const ingest::ModelRegistry& models_;
  DriftOptions options_;
};

// The parts of the daemon that diagnoses and adoptions use; all are safe to use from any thread.
struct Parts {
  const history::Store& store;
  history::Writer& writer;
  ingest::ModelRegistry& models;
  const DriftView& drift;
  std::function<std::int64_t()> now_utime_us;
  std::function<void(const Error&)> on_error = [](const Error&) {};
};

}  // namespace joulecast::server
