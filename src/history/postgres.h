#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>

#include "history/sql.h"

struct pg_conn;
struct pg_result;

namespace joulecast::history {

struct PostgresResultDeleter {
  void operator()(pg_result* result) const;
};
using PostgresResult = std::unique_ptr<pg_result, PostgresResultDeleter>;

// Whether libpq can read it: its options and hosts. Fault::invalid on "url".
Result<void> check_postgres_url(const std::string& url);

// A connection through libpq. The URL is libpq's (postgresql://user@host1,host2/database?option=value).
class PostgresDatabase final : public Database {
 public:
  // `application_name` identifies the connection in pg_stat_activity. Of several hosts one that takes writes
  // is used, unless the URL specifies another (libpq's target_session_attrs).
  PostgresDatabase(const std::string& url, const std::string& application_name);
  ~PostgresDatabase() override;

  void execute(const std::string& sql) override;
  std::unique_ptr<Statement> prepare(std::string_view sql) override;
  bool has_table(std::string_view name) override;
  bool is_postgres() const override { return true; }
  void finish_later() override {
    if (sent_ > 0) (void)read_sent();
  }
  bool is_usable() const override;
  bool in_transaction() const override;
  void begin(Access access) override;
  // Throws SqlError::Kind::commit_unknown when the connection is lost before the answer.
  void commit() override;
  void roll_back() override;

  // The server ends every further statement after that time (0: unlimited), or after waiting 1 s for a lock.
  void limit_statements(std::chrono::milliseconds limit);

  pg_conn* handle() const { return handle_; }
  // The name of a prepared statement of that text, in which parameters are $1, $2 and so on.
  std::string prepare_as_name(const std::string& sql);
  // A statement was sent in pipeline mode and its result is to be read.
  void sent_later();
  bool has_sent() const { return sent_ > 0; }
  // Enters pipeline mode unless it is entered.
  void enter_pipeline();
  // Results of all that was sent; answers the last one. Throws the first error.
  PostgresResult read_sent();
  // The result, or its error thrown.
  PostgresResult checked(pg_result* result);
  [[noreturn]] void raise(const pg_result* result);

 protected:
  std::unique_ptr<Statement> prepare_to_keep(std::string_view sql) override;

 private:
  pg_conn* handle_ = nullptr;
  bool is_lost_ = false;
  int sent_ = 0;
  std::int64_t names_ = 0;
};

}  // namespace joulecast::history
