#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <string>
#include <thread>

#include "history/store.h"
#include "history/writer.h"
#include "server/diagnosis/model_adoption.h"

namespace joulecast::server {

// Whether a person may be offered the proposal: it is open, and a calibration has passed its back-test.
bool is_offered(const history::Proposal& proposal);

struct ReviewOptions {
  bool automatic = false;  // adopt a proposal that passes
  // The robots for which this daemon of a cluster reviews proposals; empty: all.
  std::function<bool(const std::string& robot_id)> is_own;
  std::function<void(const std::string& robot_id, const std::string& text)> warn;
};

// Back-tests each calibration that a session proposed, on missions that it was not fitted on. One that
// improves is replaced by a proposal with the test's figures, which is offered; another is dismissed, with
// the reason as an event "proposal_dismissed".
class ProposalReview {
 public:
  ProposalReview(const history::Store& store, history::Writer& writer, ModelAdoption& adoption,
                 std::function<std::int64_t()> now_utime_us, ReviewOptions options);
  ~ProposalReview();

  // Reviews the open proposals that are not tested yet. Returns how many passed.
  int look();

  // Looks once a period, in a thread of its own, until stop().
  void start(std::chrono::milliseconds period);
  void stop();

 private:
  Result<bool> review(const history::Proposal& proposal);
  Result<void> dismiss(const history::Proposal& proposal, const std::string& reason);
  Result<void> offer(history::Proposal proposal, const Adoption& tested, AdoptionRequest request);

  const history::Store& store_;
  history::Writer& writer_;
  ModelAdoption& adoption_;
  std::function<std::int64_t()> now_utime_us_;
  ReviewOptions options_;
  std::mutex mutex_;
  std::condition_variable wake_;
  bool running_ = false;
  std::thread thread_;
};

}  // namespace joulecast::server
