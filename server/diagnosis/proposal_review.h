#pragma once

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <utility>

#include "history/store.h"
#include "history/writer.h"
#include "server/diagnosis/model_adoption.h"

namespace joulecast::server {

struct ReviewOptions {
  bool automatic = false;  // adopt a proposal that passes
  std::function<void(const std::string& robot_id, const std::string& text)> warn;
};

// Back-tests the models that sessions suggest for robots without an open proposal, on missions that they were
// not fitted on. One that improves beyond chance, on the model of a diagnosis too where one may be adopted,
// becomes the robot's proposal with the test's figures. A proposal that no longer improves the model, or
// whose robot changed since, is dismissed with the reason as an event "proposal_dismissed".
class ProposalReview {
 public:
  ProposalReview(Parts parts, ModelAdoption& adoption, ReviewOptions options)
      : parts_(std::move(parts)), adoption_(adoption), options_(std::move(options)) {}

  // To be called by sessions; do not wait.
  void suggest(history::Proposal candidate);
  void mission_ended(const std::string& robot_id);

  // Reviews what has come. Returns how many proposals were made.
  int look();

  // Looks when something has come, in a thread of its own, until stop().
  void start();
  void stop() { thread_ = {}; }

 private:
  Result<bool> review(history::Proposal candidate);
  Result<void> review_open(const std::string& robot_id);
  // The robot's open proposal for the model in force.
  Result<std::optional<history::Proposal>> open_of(const std::string& robot_id) const;
  // The model of the robot's newest diagnosis, where it may be adopted in place of this version.
  Result<std::optional<history::DiagnosisRecord>> remedy(const std::string& robot_id,
                                                         std::optional<std::int64_t> version) const;
  Result<void> dismiss(const history::Proposal& proposal, const std::string& reason);

  const Parts parts_;
  ModelAdoption& adoption_;
  ReviewOptions options_;
  std::mutex mutex_;
  std::condition_variable_any wake_;
  std::map<std::string, history::Proposal> suggested_;  // by robot: the newest counts
  std::set<std::string> ended_;
  std::jthread thread_;
};

}  // namespace joulecast::server
