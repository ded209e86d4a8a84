#pragma once

#include <array>
#include <atomic>
#include <bitset>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <vector>

// LCM's UDP format, read without trusting it. A short message is one datagram: "LC02", sequence number (4
// bytes), the channel's name with a final zero byte, the message. A longer one comes in fragments: "LC03",
// sequence number, size of the message, offset of the fragment (4 bytes each), number of the fragment, their
// count (2 bytes each), in the first the channel's name, then bytes of the message. All numbers are
// big-endian.
namespace joulecast::telemetry {

// LCM counts in int; no message of the contract comes near this.
inline constexpr std::size_t max_message_bytes = 64 * 1024;

// Sender of a datagram: IPv4 address and port in host byte order. Port 0: unknown, it did not come by UDP.
struct Sender {
  std::uint32_t address = 0;
  std::uint16_t port = 0;

  [[nodiscard]] bool known() const noexcept { return port != 0; }
  friend bool operator==(const Sender&, const Sender&) = default;
};

// "10.0.0.7:40123"; "an unknown sender".
[[nodiscard]] std::string to_string(const Sender& sender);

// Why a datagram gave no message. Names are labels of the metrics.
enum class DatagramFault : std::size_t {
  kernel,              // lost because the kernel's receive buffer was full
  foreign_sender,      // its sender is not among those accepted
  malformed,           // no LCM datagram
  other_channel,       // LCM traffic of others on the group: no fault
  too_large,           // of a message larger than any of the contract
  bad_fragment,        // offset, length, number or count impossible, or contradicting an earlier fragment's
  duplicate_fragment,  // came already
  incomplete           // messages discarded because fragments did not come in time, or too many were begun
};

inline constexpr std::array<std::string_view, 8> datagram_fault_names = {
    "kernel",    "foreign_sender", "malformed",          "other_channel",
    "too_large", "bad_fragment",   "duplicate_fragment", "incomplete"};

// Written by the receiving thread, read by the metrics.
struct DatagramCounters {
  static constexpr std::size_t max_other_channels = 16;

  std::atomic<std::uint64_t> received = 0;            // datagrams
  std::set<std::string, std::less<>> other_channels;  // the first ones; the receiving thread's alone
  std::array<std::atomic<std::uint64_t>, datagram_fault_names.size()> faults{};

  void note_other_channel(std::string_view channel) {
    if (other_channels.size() < max_other_channels && !other_channels.contains(channel))
      other_channels.emplace(channel);
  }
  void add(DatagramFault fault, std::uint64_t count = 1) noexcept {
    faults[static_cast<std::size_t>(fault)].fetch_add(count, std::memory_order_relaxed);
  }
};

struct ChannelMessage {
  std::string_view channel;
  std::span<const std::uint8_t> data;
};

struct ReassemblyLimits {
  std::size_t messages = 64;  // incomplete at the same time, so 4 MiB; beyond: the oldest is discarded
  std::size_t messages_a_sender = 4;
  std::int64_t timeout_us = 1'000'000;  // from a message's first fragment to its last
};

// From datagrams to messages on the channels that robots publish. A pure state machine: no socket, no clock.
class DatagramReader {
 public:
  explicit DatagramReader(DatagramCounters& counters, ReassemblyLimits limits = {})
      : counters_(counters), limits_(limits) {}

  // The message that the datagram is or completes; the views end with the datagram's bytes or the next call.
  // `now_us` of any clock that does not go back.
  std::optional<ChannelMessage> take(const Sender& sender, std::span<const std::uint8_t> datagram,
                                     std::int64_t now_us);
  // Discards messages that have waited too long for their fragments.
  void expire(std::int64_t now_us);

  [[nodiscard]] std::size_t messages_begun() const noexcept { return begun_.size(); }

 private:
  // liblcm's smallest fragments, 1,400 bytes, make 47 of the largest message.
  static constexpr std::size_t max_fragments = 256;

  struct Fragment {
    std::uint32_t sequence = 0, size = 0, offset = 0;
    std::uint16_t number = 0, count = 0;
    std::string_view channel;  // of number 0
    std::span<const std::uint8_t> data;
  };
  struct Begun {
    Sender sender;
    std::uint32_t sequence = 0;
    std::uint16_t count = 0;
    std::int64_t since_us = 0;
    std::string channel;  // empty: the first fragment has not come
    std::vector<std::uint8_t> data;
    std::bitset<max_fragments> came;
    std::vector<std::array<std::uint32_t, 2>> spans;  // offset and end of each fragment
    std::size_t bytes = 0;
  };

  std::optional<ChannelMessage> take_fragment(const Sender& sender, std::span<const std::uint8_t> datagram,
                                              std::int64_t now_us);
  // Empty, and counted, if the datagram is no acceptable fragment of a message.
  std::optional<Fragment> parse_fragment(std::span<const std::uint8_t> datagram);
  std::vector<Begun>::iterator begin(const Sender& sender, const Fragment& fragment, std::int64_t now_us);
  static bool fits(const Begun& message, const Fragment& fragment);
  std::nullopt_t refuse(DatagramFault fault) noexcept;
  std::nullopt_t refuse_channel(std::string_view channel);

  DatagramCounters& counters_;
  ReassemblyLimits limits_;
  std::vector<Begun> begun_;  // oldest first
  Begun completed_;
};

}  // namespace joulecast::telemetry
