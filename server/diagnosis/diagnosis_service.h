#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "base/error.h"
#include "history/store.h"
#include "history/writer.h"
#include "ingest/model_registry.h"
#include "server/diagnosis/drift_view.h"

namespace joulecast::server {

struct DiagnosisOptions {
  std::size_t queue = 32;                                   // jobs that may wait; beyond: Fault::unavailable
  std::size_t max_missions = 200;                           // of one job, newest first
  std::size_t max_samples = 500'000;                        // of one job: bounds its memory and time
  std::uint64_t max_memory_bytes = std::uint64_t{1} << 30;  // of a job beyond the daemon's own
  std::chrono::milliseconds deadline{3'600'000};            // of a job
};

struct DiagnosisRequest {
  std::string robot_id;
  std::vector<history::MissionKey> missions;  // empty: the newest
  // Of the newest, those that started from then on; absent: from the robot's last drift on, where it had one.
  std::optional<std::int64_t> since_utime_us;
  std::size_t max_missions = 200;
  double hold_back = 0.25;  // share of the missions left for a back-test; one at least of three or more
  history::DiagnosisCause cause = history::DiagnosisCause::request;
};

// Where a job stands.
struct DiagnosisProgress {
  std::int64_t id = 0;
  history::DiagnosisState state = history::DiagnosisState::queued;
  double fraction = 0;    // of the work, 0 to 1
  std::size_t ahead = 0;  // jobs before it in the queue
  std::optional<std::int64_t> started_utime_us;
};

struct DiagnosisCounts {
  std::uint64_t done = 0, failed = 0, cancelled = 0;
  std::size_t waiting = 0;
  bool running = false;
  double seconds = 0;  // spent on jobs
};

// Diagnoses as jobs: a bounded queue and one thread of low priority, each job a process of its own
// (server/diagnosis/confined.h) that can crash without the service. Jobs and results are kept in the store;
// jobs that a stop of the service interrupted are marked so at the next start.
class DiagnosisService {
 public:
  using Ended = std::function<void(const history::DiagnosisRecord&)>;

  // `on_ended` is called with every job that has ended and is stored; called on the service's thread.
  DiagnosisService(Parts parts, const DiagnosisOptions& options, Ended on_ended = {})
      : parts_(std::move(parts)), options_(options), on_ended_(std::move(on_ended)) {}
  ~DiagnosisService() { stop(); }  // cancels the running job

  // Marks jobs that the last daemon left unfinished, then starts to work.
  Result<void> start();
  void stop();

  // Additions of a request to the transaction of its change, from the job as it is then and, of one that
  // waits, the number before it.
  using Closing = std::function<history::Change(const history::DiagnosisRecord&, std::size_t ahead)>;

  // Queues a job and answers its id. Fault::not_found: no such robot or mission; ::conflict: the robot has no
  // mission that has ended; ::unavailable: the queue is full.
  Result<std::int64_t> submit(const DiagnosisRequest& request, const Closing& closing = {});
  // Runs a stored job that another daemon of the cluster left behind.
  Result<void> take_over(std::int64_t id);
  // Fault::not_found, or ::conflict when it has ended.
  Result<void> cancel(std::int64_t id, const Closing& closing = {});

  // Absent when the job has ended or never existed: query the store.
  std::optional<DiagnosisProgress> progress(std::int64_t id) const;

  bool waits_or_runs(const std::string& robot_id) const;
  DiagnosisCounts counts() const;

 private:
  struct Job;
  bool stopping() const { return thread_.get_stop_token().stop_requested(); }
  // Whether the robot has a mission that a diagnosis could read.
  Result<void> any_ended(const DiagnosisRequest& request) const;
  void work(const std::stop_token& stop);
  void run(Job& job);
  Result<void> judge(Job& job);
  void end_record(history::DiagnosisRecord& record, history::DiagnosisState state, std::string error) const;
  void finish(Job& job, history::DiagnosisState state, std::string error, std::string report);
  void settle(Job& job);

  const Parts parts_;
  DiagnosisOptions options_;
  Ended on_ended_;
  std::string report_;     // of the job that runs, as HTML
  std::mutex submitting_;  // between looking at the queue and entering it
  mutable std::mutex mutex_;
  std::condition_variable_any wake_;
  std::deque<std::shared_ptr<Job>> waiting_;
  std::shared_ptr<Job> running_;
  DiagnosisCounts counts_;
  std::jthread thread_;
};

}  // namespace joulecast::server
