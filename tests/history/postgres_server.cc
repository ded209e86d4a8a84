#include "postgres_server.h"

#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdlib>
#include <functional>
#include <stdexcept>

#include "history/open_store.h"
#include "history/postgres.h"
#include "store_kind.h"

namespace joulecast::history {
namespace {

constexpr int not_installed = 77;

const TemporaryFolder& server_folder() {
  static const TemporaryFolder folder;
  return folder;
}

int tell_server(const std::string& what) {
  const std::string command =
      JOULECAST_SOURCE_DIR "/tests/support/postgresql.sh " + what + " " + server_folder().file("");
  const int status = std::system(command.c_str());
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

std::string server_url() {
  return "postgresql://joulecast@/postgres?host=" + server_folder().file("");
}

std::string schema_of(const TemporaryFolder& folder) {
  return "t" + std::to_string(std::hash<std::string>()(folder.file("")));
}

}  // namespace

std::string postgres_url(const TemporaryFolder& folder) {
  const std::string schema = schema_of(folder);
  PostgresDatabase(server_url(), "test").execute("CREATE SCHEMA IF NOT EXISTS " + schema);
  return server_url() + "&options=-csearch_path%3D" + schema;
}

std::string as_administrator(const TemporaryFolder& folder, const std::string& sql) {
  return PostgresDatabase(server_url() + "&options=-csearch_path%3D" + schema_of(folder), "test").text(sql);
}

std::string postgres_socket() {
  return server_folder().file(".s.PGSQL.5432");
}

void start_postgres() {
  if (tell_server("start") != 0) throw std::runtime_error("PostgreSQL did not start");
}

void stop_postgres() {
  tell_server("stop");
}

StoreKind store_kind() {
  return {"Postgres",
          [](const TemporaryFolder& folder, std::function<std::int64_t()> clock) {
            return need(open_store(postgres_url(folder), {.now_utime_us = std::move(clock)}));
          },
          postgres_url};
}

}  // namespace joulecast::history

int main(int argc, char** argv) {
  ::testing::InitGoogleTest(&argc, argv);
  // Skipped where PostgreSQL is not installed; where it is and does not start, the test fails.
  const int started = joulecast::history::tell_server("start");
  if (started != 0) return started == joulecast::history::not_installed ? started : 1;
  const int result = RUN_ALL_TESTS();
  joulecast::history::stop_postgres();
  return result;
}
