#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "base/error.h"
#include "server/settings.h"

namespace joulecast {

// joulecastd put together: store and writer, models, ingest, HTTP. The one place where the parts meet.
class Application {
 public:
  // Opens the store, loads the models, starts ingest and HTTP. When it returns, the service answers.
  static Result<std::unique_ptr<Application>> start(const Settings& settings);
  ~Application();
  Application(const Application&) = delete;
  Application& operator=(const Application&) = delete;

  // The port really bound.
  std::uint16_t http_port() const;
  // The file or, without its password, the URL of the history.
  std::string store_name() const;

  // True while every loop turns: receiving, accounting, writing, HTTP. What the watchdog asks.
  bool alive();

  // Reads again what may change while it runs: the tokens and the certificate. What cannot be read is logged,
  // and what was in force stays.
  void reload();

  // Stops in order: receiving, accounting (open missions are checkpointed), HTTP, writing. What the store
  // does not take goes to the spool beside it. False when a part did not end in time: the process is to end
  // by _exit().
  bool stop();

 private:
  struct Parts;
  explicit Application(std::unique_ptr<Parts> parts);
  std::unique_ptr<Parts> parts_;
};

// What is wrong with who may use the service: an address open to all, a token file or a
// certificate that cannot be used.
std::vector<Error> faults_of_access(const Settings& settings);

// What is wrong with the URL of the history; nothing is asked of it.
std::vector<Error> faults_of_store(const Settings& settings);

// What is wrong with whose telemetry is taken: the robots' keys, the list of senders.
std::vector<Error> faults_of_telemetry(const Settings& settings);

// What is wrong with the part in a cluster that the settings name.
std::vector<Error> faults_of_cluster(const Settings& settings);
// What is wrong with the file of the webhooks and their secrets.
std::vector<Error> faults_of_webhooks(const Settings& settings);
// What is wrong with the MQTT broker that the settings name; it is not asked.
std::vector<Error> faults_of_mqtt(const Settings& settings);

// What is wrong with the robot files that the settings name, one a file; or with their directory.
std::vector<Error> faulty_robot_files(const Settings& settings);

// The SQLite file of the history. Fault::invalid on "store.url" where the history is in PostgreSQL, whose own
// programs check it, back it up and restore it.
Result<std::string> store_file(const Settings& settings);

// The OpenAPI document of the table that start() would serve.
Result<std::string> openapi_document();

}  // namespace joulecast
