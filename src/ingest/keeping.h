#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "history/commands.h"

namespace joulecast::ingest {

// Which robots this daemon of a cluster keeps: between the thread that holds the leases, which decides, and
// the accountant, which does it. Any thread.
class Keeping {
 public:
  struct Grant {
    std::string robot_id;
    history::Epoch epoch = 0;
    std::optional<history::StreamPosition> position;  // of the last sample that is stored
  };
  struct Withdrawal {
    std::string robot_id;
    history::Epoch epoch = 0;
    bool orderly = true;  // false: the lease is another's already, and nothing more can be stored
  };
  struct Orders {
    std::vector<Withdrawal> withdrawals;  // first
    std::vector<Grant> grants;
  };

  // Robots with a lease, and the last sample of each that is stored.
  using Leases = std::map<std::string, std::optional<history::StreamPosition>, std::less<>>;

  // Of the thread that holds the leases.
  void note_leases(Leases leases);
  void grant(Grant grant);
  void withdraw(Withdrawal withdrawal);
  void withdraw_all() {
    for (const auto& [robot_id, epoch] : kept()) withdraw({robot_id, epoch, false});
  }
  // The robots from which messages were received, by id, with the host's time of the last one.
  std::map<std::string, std::int64_t> heard() const;
  // Clears the times of the last messages: buffered messages are incomplete.
  void forget_heard();

  // Of the accountant.
  bool has_orders() const { return has_orders_.load(std::memory_order_acquire); }
  Orders take_orders();
  void hear(std::string_view robot_id, std::int64_t host_utime_us);
  // Those noted since the last call; absent: none were read.
  std::optional<Leases> take_leases();

  // The epoch under which a robot is kept; 0: it is not.
  history::Epoch epoch_of(std::string_view robot_id) const;
  std::map<std::string, history::Epoch, std::less<>> kept() const;

  std::atomic<std::uint64_t> resumed_missions = 0, held_dropped = 0;
  std::atomic<std::size_t> held_messages = 0, held_bytes = 0;

 private:
  mutable std::mutex mutex_;
  std::atomic<bool> has_orders_ = false;
  Orders orders_;
  std::optional<Leases> leases_;
  std::map<std::string, history::Epoch, std::less<>> kept_;
  std::map<std::string, std::int64_t, std::less<>> heard_;
};

}  // namespace joulecast::ingest
