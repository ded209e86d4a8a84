#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "answers/battery_dialects.h"
#include "base/error.h"

struct mosquitto;

namespace joulecast::server {

struct BrokerOptions {
  std::string host;
  int port = 1883;
  bool tls = false;
  std::string authorities;  // PEM file; empty: those of the system
  std::string user, password;
  std::string client_id;

  // mqtt://host[:port] (1883) or mqtts://host[:port] (8883, by TLS). Fault::invalid on "mqtt.url".
  Result<void> set_url(const std::string& url);
};

// A connection to an MQTT 3.1.1 broker, made again when it is lost (after 1 s to 60 s). Any thread.
class BrokerLink {
 public:
  // `on_change(text)` is called with an empty text when the connection is made, and with the reason when it
  // is lost or fails: on a thread of the link's.
  BrokerLink(BrokerOptions options, std::function<void(const std::string& why)> on_change)
      : options_(std::move(options)), on_change_(std::move(on_change)) {}
  ~BrokerLink() { stop(); }

  // `last_words` on `last_topic` is the will message: the broker publishes it, retained, if the daemon
  // vanishes. Fault::invalid where the broker's name or the authorities are unusable; not for an unreachable
  // broker.
  Result<void> start(const std::string& last_topic, const std::string& last_words);
  bool is_connected() const { return connected_; }
  // Fault::unavailable without a connection; the message is not queued. Retained messages have quality of
  // service 1, others 0.
  Result<void> publish(const std::string& topic, const std::string& message, bool retained);
  // Disconnects from the broker.
  void stop();

 private:
  Result<void> set_tls();
  void run(int code);
  bool has_left();
  void on_connect(int code);
  void on_acknowledged(int message);
  void tell(const char* why);

  const BrokerOptions options_;
  const std::function<void(const std::string&)> on_change_;
  mosquitto* handle_ = nullptr;
  std::atomic<bool> connected_ = false;
  std::thread thread_;
  std::string fault_;  // errors that the library logged during this attempt; of the thread
  std::mutex mutex_;
  std::condition_variable wake_;
  int awaited_ = 0;       // the last message that requires an acknowledgement
  int acknowledged_ = 0;  // the last that has one, or requires none and is sent
  std::optional<std::chrono::steady_clock::time_point> leave_until_;  // set: no connection is made any more
};

// The batteries of live robots on an MQTT broker, in the format of VDA 5050:
//   <interface>/<v3 or v2>/<manufacturer>/<robot_id>/<powerSupply or batteryState>
// every period, not retained: the header that every VDA 5050 message has (headerId, timestamp, version,
// manufacturer, serialNumber) and the object of that name from the state of the standard's own topic. Other
// members of the state, orders and nodes, are not published, and the robot's own topics are not written.
//   <interface>/<v3 or v2>/joulecast/<client id>/connection
// retained: the standard's connection message, of this daemon: ONLINE, OFFLINE after an orderly stop,
// CONNECTION_BROKEN (2.1: CONNECTIONBROKEN) published by the broker.
class BatteryTopics {
 public:
  struct Options {
    BrokerOptions broker;
    std::string interface, manufacturer;
    answers::Dialect dialect = answers::Dialect::vda5050_3_0;  // or vda5050_2_1
    std::chrono::milliseconds period{5000};
    std::function<std::int64_t()> now_utime_us = {};
    // As of BrokerLink, but only the first of several failed attempts.
    std::function<void(const std::string& why)> on_change = {};
  };
  struct Battery {
    std::string robot_id;
    std::string object;  // JSON, {"powerSupply": {...}} or {"batteryState": {...}}
  };
  // The batteries of all live robots of this daemon, in that dialect.
  using Batteries = std::function<std::vector<Battery>()>;

  BatteryTopics(Options options, Batteries batteries);
  ~BatteryTopics() { stop(); }

  // Fault::invalid: see BrokerLink.
  Result<void> start();
  void stop();

  struct Status {
    bool connected = false;
    std::uint64_t connections = 0, published = 0, failed = 0;  // messages
  };
  Status status() const;

 private:
  std::string topic(const std::string& manufacturer, const std::string& serial_number,
                    const std::string& name) const;
  std::string connection_message(const std::string& state);
  std::string begin_message(const std::string& topic, const std::string& manufacturer,
                            const std::string& serial_number);
  void on_change(const std::string& why);
  void run(const std::stop_token& stop);
  void publish_all();

  Options options_;
  const Batteries batteries_;
  const std::string connection_topic_;
  std::map<std::string, std::uint32_t> header_ids_;  // of each topic
  mutable std::mutex mutex_;
  std::condition_variable_any wake_;
  bool refused_ = false, greet_ = false;
  std::atomic<std::uint64_t> connections_ = 0, published_ = 0, failed_ = 0;
  BrokerLink link_;
  std::jthread thread_;
};

}  // namespace joulecast::server
