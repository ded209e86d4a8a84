#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "history/commands.h"
#include "ingest/inbound_message.h"

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

// The messages of robots that another daemon of the cluster keeps, since those that it has stored, for when
// this daemon has to go on in its place. Bounded by bytes in all: the robot with most loses its oldest.
class HeldMessages {
 public:
  // `age_us`: how long messages are kept of a robot without a lease, and before the last stored sample of one
  // with a lease, since events from then may not be stored yet.
  HeldMessages(std::int64_t age_us, std::size_t room_bytes) : age_us_(age_us), room_bytes_(room_bytes) {}

  // Answers how many were discarded for want of room.
  std::size_t add(const InboundMessage& message);
  // The robot's, oldest first; they are no longer held.
  std::deque<InboundMessage> take(std::string_view robot_id);
  // Drops stored messages. `now_read`: leases were just read; else messages of robots with leases are kept.
  void forget_stored(std::int64_t host_utime_us, const Keeping::Leases& leases, bool now_read);
  std::size_t size() const { return size_; }
  std::size_t bytes() const { return bytes_; }

 private:
  void drop_first(std::deque<InboundMessage>& held, std::size_t count);

  std::int64_t age_us_;
  std::size_t room_bytes_;
  std::size_t size_ = 0, bytes_ = 0;
  std::map<std::string, std::deque<InboundMessage>, std::less<>> robots_;
};

}  // namespace joulecast::ingest
