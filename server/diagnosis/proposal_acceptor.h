#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <thread>

#include "history/store.h"
#include "server/diagnosis/model_adoption.h"

namespace joulecast::server {

// Adopts calibration proposals automatically when their back-test improves. A rejected proposal stays open
// for a person; it is not tried again.
class ProposalAcceptor {
 public:
  // `is_own`: the robots for which this daemon of a cluster looks at proposals; empty: all.
  ProposalAcceptor(const history::Store& store, ModelAdoption& adoption,
                   std::function<void(const std::string& robot_id, const std::string& text)> warn,
                   std::function<bool(const std::string& robot_id)> is_own = {});
  ~ProposalAcceptor();

  // Tries the open proposals that came since the last look. Returns how many were adopted.
  int look();

  // Looks once a period, in a thread of its own, until stop().
  void start(std::chrono::milliseconds period);
  void stop();

 private:
  bool try_one(const history::Proposal& proposal);

  const history::Store& store_;
  ModelAdoption& adoption_;
  std::function<void(const std::string&, const std::string&)> warn_;
  std::function<bool(const std::string&)> is_own_;
  std::int64_t seen_id_ = 0;
  std::mutex mutex_;
  std::condition_variable wake_;
  bool running_ = false;
  std::thread thread_;
};

}  // namespace joulecast::server
