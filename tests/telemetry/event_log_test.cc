#include "telemetry/event_log.h"

#include <gtest/gtest.h>
#include <lcm/lcm.h>

#include <chrono>
#include <cstring>
#include <memory>

#include "temporary_file.h"

namespace joulecast::telemetry {
namespace {

using test::TemporaryFile;
using Bytes = std::vector<std::uint8_t>;

Bytes payload(std::size_t size, std::uint8_t seed) {
  Bytes bytes(size);
  for (std::size_t i = 0; i < size; ++i) bytes[i] = static_cast<std::uint8_t>(seed + i);
  return bytes;
}

// Three events of 28 + 3 + {10, 0, 200} bytes.
constexpr std::size_t starts[] = {0, 41, 72};
constexpr std::size_t whole_size = 303;

Bytes three_events() {
  const TemporaryFile file;
  auto log = EventLogWriter::create(file.path()).value();
  EXPECT_TRUE(log.write(100, "abc", payload(10, 1)));
  EXPECT_TRUE(log.write(200, "def", payload(0, 0)));
  EXPECT_TRUE(log.write(300, "ghi", payload(200, 7)));
  EXPECT_TRUE(log.close());
  return file.get();
}

// Returns the bytes in pieces of `piece`, as a slow disk might.
EventLogReader reader_of(Bytes bytes, std::size_t piece = 1 << 16, LogLimits limits = {}) {
  auto at = std::make_shared<std::size_t>(0);
  return EventLogReader(
      [bytes = std::move(bytes), at, piece](std::span<std::uint8_t> into) {
        const std::size_t count = std::min({piece, into.size(), bytes.size() - *at});
        if (count > 0) std::memcpy(into.data(), bytes.data() + *at, count);
        *at += count;
        return static_cast<std::ptrdiff_t>(count);
      },
      limits);
}

TEST(EventLog, IsReadableByLcm) {
  const TemporaryFile file;
  file.put(three_events());
  lcm_eventlog_t* log = lcm_eventlog_create(file.path().c_str(), "r");
  ASSERT_NE(log, nullptr);
  const char* channels[] = {"abc", "def", "ghi"};
  for (int i = 0; i < 3; ++i) {
    lcm_eventlog_event_t* event = lcm_eventlog_read_next_event(log);
    ASSERT_NE(event, nullptr);
    EXPECT_EQ(event->eventnum, i);
    EXPECT_EQ(event->timestamp, 100 * (i + 1));
    EXPECT_STREQ(event->channel, channels[i]);
    lcm_eventlog_free_event(event);
  }
  EXPECT_EQ(lcm_eventlog_read_next_event(log), nullptr);
  lcm_eventlog_destroy(log);
}

TEST(EventLog, ReadsPiecesOfAnySize) {
  for (const std::size_t piece : {std::size_t{1}, std::size_t{7}, std::size_t{4096}}) {
    EventLogReader reader = reader_of(three_events(), piece, {63, 1000, 50});
    for (std::size_t i = 0; i < 3; ++i) {
      const LogRead read = reader.next();
      ASSERT_EQ(read.status, LogStatus::event);
      EXPECT_EQ(read.offset, starts[i]);
      EXPECT_EQ(read.event.number, static_cast<std::int64_t>(i));
      EXPECT_EQ(read.event.timestamp_us, 100 * static_cast<std::int64_t>(i + 1));
    }
    const LogRead end = reader.next();
    EXPECT_EQ(end.status, LogStatus::end);
    EXPECT_EQ(end.offset, whole_size);
    EXPECT_EQ(reader.next().status, LogStatus::end);
  }
}

TEST(EventLog, DataAndChannelAreExact) {
  EventLogReader reader = reader_of(three_events());
  reader.next();
  reader.next();
  const LogRead read = reader.next();
  EXPECT_EQ(read.event.channel, "ghi");
  EXPECT_EQ(Bytes(read.event.data.begin(), read.event.data.end()), payload(200, 7));
}

// A cut at an event boundary is a clean end; any other cut is reported as truncation at the event that was
// cut.
TEST(EventLog, ReportsEveryTruncation) {
  const Bytes whole = three_events();
  ASSERT_EQ(whole.size(), whole_size);
  for (std::size_t size = 0; size <= whole.size(); ++size) {
    EventLogReader reader =
        reader_of(Bytes(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size)));
    std::size_t events = 0;
    LogRead read = reader.next();
    for (; read.status == LogStatus::event; read = reader.next()) ++events;
    const std::size_t expected_events = size >= whole_size  ? 3u
                                        : size >= starts[2] ? 2u
                                        : size >= starts[1] ? 1u
                                                            : 0u;
    const bool boundary = size == 0 || size == starts[1] || size == starts[2] || size == whole_size;
    EXPECT_EQ(events, expected_events);
    EXPECT_EQ(read.status, boundary ? LogStatus::end : LogStatus::truncated) << "cut at " << size;
    EXPECT_EQ(read.offset, expected_events == 3 ? whole_size : starts[expected_events]);
  }
}

TEST(EventLog, ReportsDamageAndSkippedBytes) {
  Bytes bytes = three_events();
  bytes[starts[1]] = 0;  // the second event's sync word
  EventLogReader reader = reader_of(bytes);
  EXPECT_EQ(reader.next().status, LogStatus::event);
  for (int i = 0; i < 2; ++i) {
    const LogRead damaged = reader.next();
    EXPECT_EQ(damaged.status, LogStatus::corrupt);
    EXPECT_EQ(damaged.offset, starts[1]);
  }
  EXPECT_EQ(reader.resync(), starts[2] - starts[1]);
  const LogRead read = reader.next();
  ASSERT_EQ(read.status, LogStatus::event);
  EXPECT_EQ(read.event.channel, "ghi");
  EXPECT_EQ(reader.next().status, LogStatus::end);
  EXPECT_EQ(reader.skipped_bytes(), starts[2] - starts[1]);
}

TEST(EventLog, ImplausibleLengthsAreCorrupt) {
  for (const std::size_t field : {20u, 24u}) {
    for (const int high : {0x7F, 0x80, 0xFF}) {
      Bytes bytes = three_events();
      bytes[starts[1] + field] = static_cast<std::uint8_t>(high);
      EventLogReader reader = reader_of(bytes);
      reader.next();
      EXPECT_EQ(reader.next().status, LogStatus::corrupt);
      reader.resync();
      EXPECT_EQ(reader.next().event.channel, "ghi");
    }
  }
  Bytes bytes = three_events();
  bytes[23] = 0;  // an empty channel name
  EXPECT_EQ(reader_of(bytes).next().status, LogStatus::corrupt);
  EXPECT_EQ(reader_of(three_events(), 1 << 16, {63, 9}).next().status, LogStatus::corrupt);
}

TEST(EventLog, ResyncIgnoresEmbeddedSyncWords) {
  const TemporaryFile file;
  auto log = EventLogWriter::create(file.path()).value();
  Bytes tricky(100, 0);
  const Bytes inner = three_events();
  std::copy_n(inner.begin(), 41, tricky.begin() + 10);  // a whole event, but no sync word or end follows it
  ASSERT_TRUE(log.write(1, "outer", tricky));
  ASSERT_TRUE(log.write(2, "next", payload(5, 5)));
  ASSERT_TRUE(log.close());
  Bytes bytes = file.get();
  bytes[0] = 0;
  EventLogReader reader = reader_of(bytes);
  EXPECT_EQ(reader.next().status, LogStatus::corrupt);
  EXPECT_EQ(reader.resync(), log_header_size + 5 + 100);
  EXPECT_EQ(reader.next().event.channel, "next");
}

TEST(EventLog, ResyncReachesEndWithoutEvents) {
  EventLogReader reader = reader_of(Bytes(1000, 0xED));
  EXPECT_EQ(reader.next().status, LogStatus::corrupt);
  EXPECT_EQ(reader.resync(), 1000u);
  EXPECT_EQ(reader.next().status, LogStatus::end);
}

TEST(EventLog, ResyncReachesEndAfterTruncation) {
  Bytes bytes = three_events();
  bytes.pop_back();
  EventLogReader reader = reader_of(bytes);
  while (reader.next().status == LogStatus::event) {
  }
  EXPECT_EQ(reader.next().status, LogStatus::truncated);
  EXPECT_EQ(reader.resync(), whole_size - 1 - starts[2]);
  EXPECT_EQ(reader.next().status, LogStatus::end);
}

// Sync words that each declare 15 MB, of which none is followed by another event.
TEST(EventLog, ResyncTakesLinearTime) {
  Bytes header = three_events();
  header.resize(log_header_size);
  header[24] = 0, header[25] = 0xF0, header[26] = 0, header[27] = 0;
  Bytes bytes{0};
  for (std::size_t k = 0; k < 50'000; ++k) bytes.insert(bytes.end(), header.begin(), header.end());
  bytes.resize(bytes.size() + (std::size_t{34} << 20));
  const auto began = std::chrono::steady_clock::now();
  EventLogReader reader = reader_of(bytes);
  EXPECT_EQ(reader.next().status, LogStatus::corrupt);
  EXPECT_EQ(reader.resync(), bytes.size());
  // 250 s where every header moves 15 MB.
  EXPECT_LT(std::chrono::steady_clock::now() - began, std::chrono::seconds(10));
}

TEST(EventLog, ReportsUnreadableSource) {
  EventLogReader reader([](std::span<std::uint8_t>) { return std::ptrdiff_t{-1}; });
  EXPECT_EQ(reader.next().status, LogStatus::failed);
}

TEST(EventLog, ReportsMissingAndUnwritableFiles) {
  EXPECT_EQ(EventLogReader::open("/no/such/log").error().fault, Fault::not_found);
  EXPECT_EQ(EventLogWriter::create("/no/such/folder/log").error().fault, Fault::unavailable);
}

TEST(EventLog, WriterRejectsUnreadableEvents) {
  const TemporaryFile file;
  auto log = EventLogWriter::create(file.path()).value();
  EXPECT_FALSE(log.write(0, "", {}));
  EXPECT_FALSE(log.write(0, std::string(64, 'c'), {}));
  EXPECT_TRUE(log.write(0, std::string(63, 'c'), {}));
  EXPECT_EQ(log.count(), 1);
}

TEST(EventLog, FullDiskIsAnError) {
  auto log = EventLogWriter::create("/dev/full");
  if (!log) GTEST_SKIP() << "this system has no /dev/full";
  ASSERT_TRUE(log->write(0, "c", payload(10, 0)));  // still in the buffer
  EXPECT_FALSE(log->close());
}

}  // namespace
}  // namespace joulecast::telemetry
