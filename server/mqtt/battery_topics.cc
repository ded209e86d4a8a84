#include "server/mqtt/battery_topics.h"

#include <fmt/format.h>
#include <mosquitto.h>

#include <algorithm>
#include <charconv>

#include "base/fault_boundary.h"
#include "base/json_writer.h"
#include "base/try.h"
#include "base/utc_time.h"
#include "http_client/http_client.h"

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

constexpr int keep_alive_s = 15;
constexpr int longest_wait_ms = 1000;  // a publication ends a wait
constexpr std::chrono::seconds first_pause{1}, last_pause{60};
constexpr std::chrono::seconds farewell{2};  // for a broker that no longer accepts messages

Result<void> done(int code, const char* field) {
  if (code == MOSQ_ERR_SUCCESS) return {};
  return fail(code == MOSQ_ERR_NO_CONN ? Fault::unavailable : Fault::invalid, field,
              mosquitto_strerror(code));
}

}  // namespace

BatteryTopics::BatteryTopics(Options options, Batteries batteries)
    : options_(std::move(options)),
      batteries_(std::move(batteries)),
      connection_topic_(topic(own_manufacturer, options_.broker.client_id, "connection")),
      link_(options_.broker, [this](const std::string& why) { on_change(why); }) {}

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
  TRY(link_.start(connection_topic_, connection_message(words_of(options_.dialect).broken)));
  thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
  return {};
}

void BatteryTopics::stop() {
  if (!thread_.joinable()) return;
  thread_ = {};
  (void)link_.publish(connection_topic_, connection_message("OFFLINE"), true);  // not sent without a broker
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
  if (is_new) options_.on_change(why);
  wake_.notify_all();
}

void BatteryTopics::run(const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  while (!stop.stop_requested()) {
    const bool greet = std::exchange(greet_, false);
    lock.unlock();
    survive("MQTT", [&] {
      if (greet && !link_.publish(connection_topic_, connection_message("ONLINE"), true)) ++failed_;
      if (link_.is_connected()) publish_all();
    });
    lock.lock();
    wake_.wait_for(lock, stop, options_.period, [this] { return greet_; });
  }
}

void BatteryTopics::publish_all() {
  for (const Battery& battery : batteries_()) {
    const std::string to = topic(options_.manufacturer, battery.robot_id, words_of(options_.dialect).object);
    const std::string message =
        begin_message(to, options_.manufacturer, battery.robot_id) + battery.object.substr(1);
    ++(link_.publish(to, message, false) ? published_ : failed_);
  }
}

Result<void> BrokerOptions::set_url(const std::string& url) {
  tls = url.starts_with("mqtts://");
  const auto refusal = invalid("mqtt.url", "must be mqtt://host[:port] or mqtts://host[:port]");
  if (!tls && !url.starts_with("mqtt://")) return refusal;
  const auto parsed = http_client::parse_url("http" + url.substr(4), "mqtt.url");
  if (!parsed || !parsed->base_path.empty()) return refusal;
  host = parsed->host;
  port = tls ? 8883 : 1883;
  // The port that an HTTP URL has when it states none.
  if (parsed->port != (tls ? "443" : "80") || url.ends_with(":" + parsed->port))
    std::from_chars(parsed->port.data(), parsed->port.data() + parsed->port.size(), port);
  return {};
}

Result<void> BrokerLink::start(const std::string& last_topic, const std::string& last_words) {
  mosquitto_lib_init();
  handle_ = mosquitto_new(options_.client_id.c_str(), true, this);
  if (handle_ == nullptr) return fail(Fault::internal, "mqtt.url", "no memory for the connection");
  mosquitto_connect_callback_set(
      handle_, [](mosquitto*, void* self, int code) { static_cast<BrokerLink*>(self)->on_connect(code); });
  mosquitto_publish_callback_set(handle_, [](mosquitto*, void* self, int message) {
    static_cast<BrokerLink*>(self)->on_acknowledged(message);
  });
  mosquitto_log_callback_set(handle_, [](mosquitto*, void* self, int level, const char* text) {
    if (level != MOSQ_LOG_ERR) return;
    std::string& fault = static_cast<BrokerLink*>(self)->fault_;
    fault.append(fault.empty() ? "" : "; ").append(text);
  });
  TRY(done(mosquitto_threaded_set(handle_, true), "mqtt.url"));
  if (options_.tls) TRY(set_tls());
  if (!options_.user.empty())
    TRY(done(mosquitto_username_pw_set(handle_, options_.user.c_str(), options_.password.c_str()),
             "mqtt.user"));
  TRY(done(mosquitto_will_set(handle_, last_topic.c_str(), static_cast<int>(last_words.size()),
                              last_words.data(), 1, true),
           "mqtt.interface"));
  const int code = mosquitto_connect_async(handle_, options_.host.c_str(), options_.port, keep_alive_s);
  if (code == MOSQ_ERR_INVAL) return done(code, "mqtt.url");
  thread_ = std::thread([this, code] { run(code); });
  return {};
}

Result<void> BrokerLink::set_tls() {
  if (options_.authorities.empty())
    return done(mosquitto_int_option(handle_, MOSQ_OPT_TLS_USE_OS_CERTS, 1), "mqtt.authorities");
  return done(mosquitto_tls_set(handle_, options_.authorities.c_str(), nullptr, nullptr, nullptr, nullptr),
              "mqtt.authorities");
}

Result<void> BrokerLink::publish(const std::string& topic, const std::string& message, bool retained) {
  if (!connected_) return fail(Fault::unavailable, "mqtt.url", "the broker is not connected");
  int id = 0;
  const int code = mosquitto_publish(handle_, &id, topic.c_str(), static_cast<int>(message.size()),
                                     message.data(), retained ? 1 : 0, retained);
  if (code == MOSQ_ERR_SUCCESS && retained) {
    const std::lock_guard lock(mutex_);
    awaited_ = id;
  }
  return done(code, "mqtt.url");
}

void BrokerLink::stop() {
  if (handle_ == nullptr) return;
  if (thread_.joinable()) {
    {
      std::unique_lock lock(mutex_);
      leave_until_ = std::chrono::steady_clock::now() + farewell;
      wake_.notify_all();
      // An acknowledgement that comes later makes the library close the connection without a farewell, and
      // the broker publish the last words.
      wake_.wait_until(lock, *leave_until_, [this] { return !connected_ || acknowledged_ == awaited_; });
    }
    mosquitto_disconnect(handle_);
    thread_.join();
  }
  mosquitto_destroy(std::exchange(handle_, nullptr));
  mosquitto_lib_cleanup();
}

// The library's own thread ends at the first fault of TLS or protocol, such as a killed broker.
void BrokerLink::run(int code) {
  std::chrono::seconds pause = first_pause;
  for (;;) {
    while (code == MOSQ_ERR_SUCCESS && !has_left()) {
      if (connected_) pause = first_pause;
      code = mosquitto_loop(handle_, longest_wait_ms, 1);
    }
    std::unique_lock lock(mutex_);
    connected_ = false;
    wake_.notify_all();
    if (leave_until_) return;
    lock.unlock();
    const std::string fault = std::exchange(fault_, {});
    tell(fault.empty() ? mosquitto_strerror(code) : fault.c_str());
    lock.lock();
    if (wake_.wait_for(lock, pause, [this] { return leave_until_.has_value(); })) return;
    lock.unlock();
    pause = std::min(2 * pause, last_pause);
    code = mosquitto_reconnect_async(handle_);
  }
}

bool BrokerLink::has_left() {
  const std::lock_guard lock(mutex_);
  return leave_until_ && (!connected_ || std::chrono::steady_clock::now() > *leave_until_);
}

void BrokerLink::on_connect(int code) {
  connected_ = code == 0;
  if (connected_) fault_.clear();
  tell(code == 0 ? "" : mosquitto_connack_string(code));
}
void BrokerLink::on_acknowledged(int message) {
  const std::lock_guard lock(mutex_);
  acknowledged_ = message;
  wake_.notify_all();
}
void BrokerLink::tell(const char* why) {
  survive("MQTT", [&] { on_change_(why); });
}

}  // namespace joulecast::server
