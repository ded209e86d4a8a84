#include "server/mqtt/battery_topics.h"

#include <fmt/format.h>

#include <utility>

#include "base/fault_boundary.h"
#include "base/json_writer.h"
#include "base/try.h"
#include "base/utc_time.h"

namespace joulecast::server {
namespace {

using answers::Dialect;

constexpr const char* own_manufacturer = "joulecast";

// Differences between the versions of the standard.
struct Words {
  const char *level, *version, *object, *broken;
};
constexpr Words words_of(Dialect dialect) {
  return dialect == Dialect::vda5050_2_1 ? Words{"v2", "2.1.0", "batteryState", "CONNECTIONBROKEN"}
                                         : Words{"v3", "3.0.0", "powerSupply", "CONNECTION_BROKEN"};
}

// VDA 5050: YYYY-MM-DDTHH:mm:ss.fffZ.
std::string timestamp(std::int64_t utime_us) {
  return fmt::format("{}.{:03}Z", format_utc(utime_us, "%Y-%m-%dT%H:%M:%S"), utime_us / 1000 % 1000);
}

}  // namespace

BatteryTopics::BatteryTopics(Options options, Batteries batteries)
    : options_(std::move(options)),
      batteries_(std::move(batteries)),
      connection_topic_(topic(own_manufacturer, options_.broker.client_id, "connection")),
      link_(broker_with_last_words(), [this](const std::string& why) { on_change(why); }) {}

BrokerOptions BatteryTopics::broker_with_last_words() {
  BrokerOptions broker = options_.broker;
  broker.last_topic = connection_topic_;
  broker.last_words = connection_message(words_of(options_.dialect).broken);
  return broker;
}

std::string BatteryTopics::topic(const std::string& manufacturer, const std::string& serial_number,
                                 const std::string& name) const {
  return fmt::format("{}/{}/{}/{}/{}", options_.interface, words_of(options_.dialect).level, manufacturer,
                     serial_number, name);
}

std::string BatteryTopics::begin_message(const std::string& topic, const std::string& manufacturer,
                                         const std::string& serial_number) {
  JsonWriter json;
  json.begin_object()
      .field("headerId", std::uint64_t{header_ids_[topic]++})
      .field("timestamp", timestamp(options_.now_utime_us()))
      .field("version", words_of(options_.dialect).version)
      .field("manufacturer", manufacturer)
      .field("serialNumber", serial_number)
      .end_object();
  std::string text = json.take();
  text.back() = ',';
  return text;
}

std::string BatteryTopics::connection_message(const std::string& state) {
  return begin_message(connection_topic_, own_manufacturer, options_.broker.client_id) +
         "\"connectionState\":\"" + state + "\"}";
}

Result<void> BatteryTopics::start() {
  TRY(link_.start());
  running_ = true;
  thread_ = std::thread([this] { run(); });
  return {};
}

void BatteryTopics::stop() {
  {
    const std::lock_guard lock(mutex_);
    if (!std::exchange(running_, false)) return;
  }
  wake_.notify_all();
  thread_.join();
  (void)link_.publish(connection_topic_, connection_message("OFFLINE"), 1,
                      true);  // without a broker it is not sent
  link_.stop();
}

BatteryTopics::Status BatteryTopics::status() const {
  return {link_.is_connected(), connections_, published_, failed_};
}

void BatteryTopics::on_change(const std::string& why) {
  bool is_new = false;
  {
    const std::lock_guard lock(mutex_);
    is_new = why.empty() || !refused_;
    refused_ = !why.empty();
    greet_ |= why.empty();
  }
  if (why.empty()) ++connections_;
  if (is_new)
    options_.note(why.empty() ? "the MQTT broker is connected" : "the MQTT broker is not connected: " + why);
  wake_.notify_all();
}

void BatteryTopics::run() {
  std::unique_lock lock(mutex_);
  while (running_) {
    const bool greet = std::exchange(greet_, false);
    lock.unlock();
    survive("MQTT", [&] {
      if (greet && !link_.publish(connection_topic_, connection_message("ONLINE"), 1, true)) ++failed_;
      if (link_.is_connected()) publish_all();
    });
    lock.lock();
    wake_.wait_for(lock, options_.period, [this] { return !running_ || greet_; });
  }
}

void BatteryTopics::publish_all() {
  for (const Battery& battery : batteries_()) {
    const std::string to = topic(options_.manufacturer, battery.robot_id, words_of(options_.dialect).object);
    const std::string message =
        begin_message(to, options_.manufacturer, battery.robot_id) + battery.object.substr(1);
    ++(link_.publish(to, message, 0, false) ? published_ : failed_);
  }
}

}  // namespace joulecast::server
