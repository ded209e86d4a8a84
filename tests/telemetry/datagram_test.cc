#include "telemetry/datagram.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <vector>

#include "telemetry/datagram_socket.h"
#include "tests/fuzz/datagram_script.h"

namespace joulecast::telemetry {
namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr Sender datagram_robot{0x0a000005, 40'000}, other_robot{0x0a000006, 40'000};
constexpr char datagram_channel[] = "ROBOT_TELEMETRY.amr-07";

void append(Bytes& bytes, std::uint64_t value, int size) {
  for (int shift = 8 * (size - 1); shift >= 0; shift -= 8)
    bytes.push_back(static_cast<std::uint8_t>(value >> shift));
}

Bytes short_message(const std::string& name, const Bytes& data) {
  Bytes bytes;
  append(bytes, 0x4c433032'00000001, 8);  // "LC02"
  bytes.insert(bytes.end(), name.begin(), name.end());
  bytes.push_back(0);
  bytes.insert(bytes.end(), data.begin(), data.end());
  return bytes;
}

struct Header {
  std::uint32_t sequence = 1, size = 0, offset = 0;
  std::uint16_t number = 0, count = 1;
};

Bytes fragment(const Header& h, const Bytes& data, const std::string& name = datagram_channel) {
  Bytes bytes{'L', 'C', '0', '3'};
  append(bytes, h.sequence, 4);
  append(bytes, h.size, 4);
  append(bytes, h.offset, 4);
  append(bytes, h.number, 2);
  append(bytes, h.count, 2);
  if (h.number == 0) {
    bytes.insert(bytes.end(), name.begin(), name.end());
    bytes.push_back(0);
  }
  bytes.insert(bytes.end(), data.begin(), data.end());
  return bytes;
}

Bytes numbered(std::size_t size) {
  Bytes bytes(size);
  for (std::size_t k = 0; k < size; ++k) bytes[k] = static_cast<std::uint8_t>(k * 7 + k / 251);
  return bytes;
}

std::vector<Bytes> fragments_of(const Bytes& message, std::size_t piece, std::uint32_t sequence = 1) {
  const std::size_t count = (message.size() + piece - 1) / piece;
  std::vector<Bytes> all;
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t from = k * piece, to = std::min(message.size(), from + piece);
    all.push_back(
        fragment({sequence, static_cast<std::uint32_t>(message.size()), static_cast<std::uint32_t>(from),
                  static_cast<std::uint16_t>(k), static_cast<std::uint16_t>(count)},
                 Bytes(message.begin() + static_cast<std::ptrdiff_t>(from),
                       message.begin() + static_cast<std::ptrdiff_t>(to))));
  }
  return all;
}

class DatagramTest : public ::testing::Test {
 protected:
  // The message that the datagram completes, or empty.
  std::optional<Bytes> take(const Bytes& datagram, const Sender& sender = datagram_robot,
                            std::int64_t now_us = 0) {
    const auto message = reader.take(sender, datagram, now_us);
    if (!message) return std::nullopt;
    EXPECT_EQ(message->channel, datagram_channel);
    return Bytes(message->data.begin(), message->data.end());
  }
  std::uint64_t count(DatagramFault fault) const { return counters.faults[static_cast<std::size_t>(fault)]; }

  DatagramCounters counters;
  DatagramReader reader{counters};
};

TEST_F(DatagramTest, ReadsShortMessages) {
  EXPECT_EQ(take(short_message(datagram_channel, {1, 2, 3})), (Bytes{1, 2, 3}));
  EXPECT_EQ(take(short_message(datagram_channel, {})), Bytes{});
  EXPECT_EQ(counters.received, 2u);
}

TEST_F(DatagramTest, RejectsOtherMessages) {
  const Bytes whole = short_message(datagram_channel, {});
  for (std::size_t size = 0; size < whole.size(); ++size)
    EXPECT_FALSE(take(Bytes(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size))));
  EXPECT_FALSE(take(short_message("", {1})));
  EXPECT_FALSE(take(short_message(std::string(64, 'x'), {1})));
  EXPECT_FALSE(take({'L', 'C', '0', '4', 0, 0, 0, 1, 'c', 0}));
  EXPECT_EQ(count(DatagramFault::malformed), whole.size() + 3);
  for (const char* name :
       {"POSE", "ENERGY_STATE.amr-07", "ROBOT_TELEMETRY.", "ROBOT_TELEMETRY.a/b", "ROBOT_TELEMETRYxa"})
    EXPECT_FALSE(take(short_message(name, {1})));
  EXPECT_EQ(count(DatagramFault::other_channel), 5u);
}

TEST_F(DatagramTest, AssemblesFragmentsInAnyOrder) {
  std::mt19937 random(1);
  std::uint32_t sequence = 0;
  for (const std::size_t size : {1u, 2u, 1399u, 1400u, 1401u, 9000u, 65'535u, 65'536u}) {
    for (const std::size_t piece :
         {size, std::max<std::size_t>(1, size / 2), std::max<std::size_t>(257, size / 200)}) {
      const Bytes message = numbered(size);
      std::vector<Bytes> all = fragments_of(message, piece, ++sequence);
      std::ranges::shuffle(all, random);
      for (std::size_t k = 0; k + 1 < all.size(); ++k) EXPECT_FALSE(take(all[k]));
      EXPECT_EQ(take(all.back()), message);
    }
  }
  EXPECT_EQ(reader.messages_begun(), 0u);
  for (const auto& fault : counters.faults) EXPECT_EQ(fault, 0u);
}

TEST_F(DatagramTest, RejectsImpossibleHeaders) {
  const Bytes data = numbered(100);
  std::uint64_t refused = 0;
  // Sizes, offsets and numbers at every limit. A possible header is a whole message or the beginning of one.
  const std::uint32_t extremes[] = {0,      1,      99,         100,        101,        200,       65'535,
                                    65'536, 65'537, 0x7fffffff, 0x80000000, 0xffffff9b, 0xffffffff};
  const std::uint16_t counts[] = {0, 1, 2, 255, 256, 257, 0xffff};
  std::uint32_t sequence = 0;
  for (const std::uint32_t size : extremes) {
    for (const std::uint32_t offset : extremes) {
      for (const std::uint16_t number : counts) {
        for (const std::uint16_t of : counts) {
          const bool possible = number < of && of <= 256 && size <= 65'536 &&
                                std::uint64_t{offset} + data.size() <= size && (number > 0 || offset == 0);
          const bool whole = possible && of == 1 && size == data.size();
          const auto taken = take(fragment({++sequence, size, offset, number, of}, data));
          EXPECT_EQ(taken.has_value(), whole) << size << " " << offset << " " << number << " " << of;
          refused += !possible || (of == 1 && !whole) ? 1 : 0;
        }
      }
    }
  }
  EXPECT_EQ(count(DatagramFault::bad_fragment) + count(DatagramFault::too_large), refused);
  EXPECT_LE(reader.messages_begun(), 4u);
}

TEST_F(DatagramTest, RejectsEmptyFragments) {
  EXPECT_FALSE(take(fragment({1, 10, 0, 0, 1}, {})));
  EXPECT_FALSE(take(fragment({2, 10, 0, 0, 1}, numbered(10), std::string(64, 'x'))));
  const Bytes whole = fragment({3, 10, 0, 0, 1}, numbered(10));
  for (std::size_t size = 0; size < whole.size(); ++size)
    EXPECT_FALSE(take(Bytes(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size))));
  EXPECT_FALSE(take(fragment({4, 10, 0, 0, 1}, numbered(10), "CAMERA")));
  EXPECT_EQ(count(DatagramFault::other_channel), 1u);
  EXPECT_EQ(reader.messages_begun(), 0u);
}

TEST_F(DatagramTest, DiscardsContradictoryFragments) {
  const Bytes data = numbered(40);
  const std::pair<Header, Header> cases[] = {
      {{1, 100, 0, 0, 3}, {1, 100, 39, 1, 3}},   // overlaps its end
      {{1, 100, 50, 1, 3}, {1, 100, 11, 2, 3}},  // overlaps its start
      {{1, 100, 0, 0, 3}, {1, 100, 0, 1, 3}},    // the same bytes under another number
      {{1, 100, 0, 0, 3}, {1, 101, 40, 1, 3}},   // another size
      {{1, 100, 0, 0, 3}, {1, 100, 40, 1, 4}},   // another count
      {{1, 100, 0, 0, 2}, {1, 100, 40, 1, 2}},   // all fragments arrived, and 20 bytes are missing
  };
  std::uint64_t expected = 0;
  for (const auto& [first, second] : cases) {
    EXPECT_FALSE(take(fragment(first, data)));
    EXPECT_EQ(reader.messages_begun(), 1u);
    EXPECT_FALSE(take(fragment(second, data)));
    EXPECT_EQ(count(DatagramFault::bad_fragment), ++expected);
    EXPECT_EQ(reader.messages_begun(), 0u);
  }
}

TEST_F(DatagramTest, IgnoresDuplicates) {
  const Bytes message = numbered(5000);
  const std::vector<Bytes> all = fragments_of(message, 1400);
  for (std::size_t k = 0; k + 1 < all.size(); ++k) {
    EXPECT_FALSE(take(all[k]));
    EXPECT_FALSE(take(all[k]));
  }
  EXPECT_EQ(take(all.back()), message);
  EXPECT_EQ(count(DatagramFault::duplicate_fragment), all.size() - 1);
}

TEST_F(DatagramTest, SeparatesSendersAndMessages) {
  const Bytes a = numbered(3000), b(3000, 9);
  const auto from_a = fragments_of(a, 1000, 7), from_b = fragments_of(b, 1000, 7),
             next = fragments_of(b, 1000, 8);
  EXPECT_FALSE(take(from_a[0]));
  EXPECT_FALSE(take(from_b[0], other_robot));
  EXPECT_FALSE(take(next[0]));
  EXPECT_FALSE(take(from_b[1], other_robot));
  EXPECT_FALSE(take(from_a[1]));
  EXPECT_FALSE(take(next[1]));
  EXPECT_EQ(take(from_b[2], other_robot), b);
  EXPECT_EQ(take(next[2]), b);
  EXPECT_EQ(take(from_a[2]), a);
}

TEST_F(DatagramTest, BoundsMemoryAndWaiting) {
  for (std::uint32_t k = 0; k < 1000; ++k) {
    EXPECT_FALSE(take(fragment({k, 65'536, 0, 0, 2}, numbered(100))));
    EXPECT_LE(reader.messages_begun(), 4u);
  }
  EXPECT_EQ(count(DatagramFault::incomplete), 996u);
  for (std::uint16_t k = 0; k < 1000; ++k) {
    EXPECT_FALSE(take(fragment({k, 65'536, 0, 0, 2}, numbered(100)), {0x0a000007, k}, 500'000));
    EXPECT_LE(reader.messages_begun(), 64u);
  }
  reader.expire(1'500'001);
  EXPECT_EQ(reader.messages_begun(), 0u);
  EXPECT_EQ(count(DatagramFault::incomplete), 2000u);
  // Such a flood does not affect a robot that sends its fragments without pause.
  const auto own = fragments_of(numbered(3000), 1400);
  EXPECT_FALSE(take(own[0], datagram_robot, 2'000'000));
  for (std::uint16_t k = 0; k < 60; ++k)
    take(fragment({k, 65'536, 0, 0, 2}, numbered(100)), {0x0a000007, k}, 2'000'000);
  EXPECT_FALSE(take(own[1], datagram_robot, 2'000'000));
  EXPECT_TRUE(take(own[2], datagram_robot, 2'000'000));
}

TEST(DatagramScripts, FuzzSeedsPass) {
  std::size_t count = 0;
  for (const auto& seed :
       std::filesystem::directory_iterator(JOULECAST_SOURCE_DIR "/tests/fuzz/seeds/datagram")) {
    std::ifstream file(seed.path(), std::ios::binary);
    const Bytes bytes{std::istreambuf_iterator<char>(file), {}};
    testing::run_datagram_script(bytes);
    ++count;
  }
  EXPECT_GE(count, 10u);
}

TEST(UdpmUrl, ParsesOrRejectsUrls) {
  const auto plain = parse_udpm_url("udpm://").value();
  EXPECT_EQ(plain.group, 0xefff4c43u);
  EXPECT_EQ(plain.port, 7667);
  const auto full = parse_udpm_url("udpm://239.1.2.3:7701?ttl=1&recv_buf_size=1000").value();
  EXPECT_EQ(full.group, 0xef010203u);
  EXPECT_EQ(full.port, 7701);
  EXPECT_EQ(full.receive_buffer_bytes, 1000);
  for (const char* bad : {"udp://", "udpm://10.0.0.1", "udpm://host:7667", "udpm://239.1.2.3:0",
                          "udpm://239.1.2.3:70000", "udpm://239.1.2.3:7667?ttl=-1",
                          "udpm://239.1.2.3:7667?ttl=x", "udpm://?recv_buf_size=0", "udpm://?speed=1"}) {
    const auto read = parse_udpm_url(bad);
    ASSERT_FALSE(read) << bad;
    EXPECT_EQ(read.error().field, "lcm.url");
  }
}

TEST(AcceptedSenders, AcceptsListedSendersOnly) {
  auto some = AcceptedSenders::parse("10.1.0.0/16, 192.168.1.7").value();
  EXPECT_TRUE(some.accepts(0x0a01ffff, 0));
  EXPECT_FALSE(some.accepts(0x0a020000, 0));
  EXPECT_TRUE(some.accepts(0xc0a80107, 0));
  EXPECT_FALSE(some.accepts(0xc0a80108, 0));
  EXPECT_FALSE(some.accepts(0x7f000001, 0));
  EXPECT_TRUE(AcceptedSenders::parse("any").value().accepts(0x01020304, 0));
  auto local = AcceptedSenders::parse("local").value();
  EXPECT_TRUE(local.accepts(0x7f000001, 0));
  EXPECT_TRUE(local.accepts(0, 0));
  EXPECT_FALSE(local.accepts(0xcb007107, 0));  // 203.0.113.7, of a documentation network (RFC 5737)
  for (const char* bad :
       {"", " ", "10.1.0.0/33", "10.1.0.0/", "10.1.0", "hosts", "10.1.0.0/16;10.2.0.0/16", "::1"}) {
    const auto parsed = AcceptedSenders::parse(bad);
    ASSERT_FALSE(parsed) << bad;
    EXPECT_EQ(parsed.error().field, "lcm.accept_from");
  }
}

}  // namespace
}  // namespace joulecast::telemetry
