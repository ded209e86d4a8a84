#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "base/error.h"
#include "server/daemon_options.h"

namespace joulecast {

// The parts of joulecastd and their connections: store and writer, models, ingest, HTTP.
class Application {
 public:
  // Opens the store, loads the models, starts ingest and HTTP. When it returns, the service is available.
  static Result<std::unique_ptr<Application>> start(const DaemonOptions& options);
  ~Application();

  // The bound port.
  std::uint16_t http_port() const;
  // The file or, without its password, the URL of the history.
  std::string store_name() const;

  // True while the loops of receiving, accounting, writing and HTTP make progress. For the watchdog.
  bool alive();

  // Reads the tokens and the certificate again. If one cannot be read, that is logged and the old one stays.
  void reload();

  // Stops in order: receiving, accounting (open missions are checkpointed), HTTP, writing. Data that are not
  // committed are written to the spool. False if a part did not end in time: the process must end by _exit().
  bool stop();

 private:
  struct Parts;
  explicit Application(std::unique_ptr<Parts> parts);
  std::unique_ptr<Parts> parts_;
};

// The SQLite file of the history. Fault::invalid on "store.url" if the history is in PostgreSQL, which has
// its own programs for check, backup and restore.
Result<std::string> store_file(const DaemonOptions& options);

// The OpenAPI document of the table that start() would serve.
Result<std::string> openapi_document();

}  // namespace joulecast
