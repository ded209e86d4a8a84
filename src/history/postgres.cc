#include "history/postgres.h"

#include <libpq-fe.h>

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cstring>
#include <utility>
#include <vector>

namespace joulecast::history {
namespace {

// Statements sent before their results are read: they fit the socket's buffer, so that neither side waits.
constexpr int max_sent = 256;

// Of the types' OIDs, which never change (pg_type.dat), those that results come in.
constexpr unsigned bool_oid = 16, bytea_oid = 17, int8_oid = 20, int2_oid = 21, int4_oid = 23,
                   float8_oid = 701;

// By SQLSTATE's class; PostgreSQL's manual, appendix A.
SqlError::Kind kind_of(std::string_view state) {
  const std::string_view of = state.substr(0, 2);
  if (of == "22" || of == "23" || of == "54" || of == "P0") return SqlError::Kind::values;
  for (const std::string_view soon : {"08", "25", "28", "40", "53", "55", "57", "58", "3D"})
    if (of == soon) return SqlError::Kind::unavailable;
  if (state == "XX001" || state == "XX002") return SqlError::Kind::corrupt;
  return SqlError::Kind::internal;
}

// On one line.
std::string trimmed(const char* message) {
  std::string text = message ? message : "";
  while (!text.empty() && (text.back() == '\n' || text.back() == ' ')) text.pop_back();
  std::ranges::replace(text, '\n', ' ');
  return text;
}

std::uint64_t big_endian(const char* bytes, std::size_t size) {
  std::uint64_t value = 0;
  for (std::size_t k = 0; k < size; ++k) value = value << 8 | static_cast<unsigned char>(bytes[k]);
  return value;
}

// ? and ?1 become $1.
std::string numbered(std::string_view sql, int& parameters) {
  std::string text;
  parameters = 0;
  for (std::size_t at = 0; at < sql.size(); ++at) {
    if (sql[at] != '?') {
      text += sql[at];
      continue;
    }
    int number = 0;
    while (at + 1 < sql.size() && sql[at + 1] >= '0' && sql[at + 1] <= '9')
      number = 10 * number + sql[++at] - '0';
    if (number == 0) number = parameters + 1;
    parameters = std::max(parameters, number);
    text += '$' + std::to_string(number);
  }
  return text;
}

// Numbers are sent as text, which the server converts to the column's type; text and bytes as they are.
class PostgresStatement final : public Statement {
 public:
  // One that is not kept has no name at the server, which would keep it as long as the connection.
  PostgresStatement(PostgresDatabase& database, std::string_view sql, bool kept)
      : database_(database), kept_(kept), sql_(numbered(sql, parameters_)) {
    const auto count = static_cast<std::size_t>(parameters_);
    data_.resize(count);
    sizes_.resize(count);
    formats_.resize(count);
    digits_.resize(count);
  }

  void bind_null(int parameter) override { put(parameter, nullptr); }
  void bind(int parameter, std::int64_t value) override { bind_number(parameter, value); }
  void bind(int parameter, double value) override { bind_number(parameter, value); }
  void bind(int parameter, std::string_view value) override {
    // libpq takes a null pointer for NULL.
    put(parameter, value.data() ? value.data() : "", static_cast<int>(value.size()), 1);
  }
  void bind(int parameter, std::span<const std::byte> value) override {
    bind(parameter, std::string_view(reinterpret_cast<const char*>(value.data()), value.size()));
  }

  bool step() override {
    if (!result_) run();
    return ++row_ < PQntuples(result_.get());
  }

  void step_later() override {
    prepare();
    database_.enter_pipeline();
    send();
    database_.sent_later();
  }

  std::int64_t changed() const override {
    const std::string_view text = result_ ? PQcmdTuples(result_.get()) : "";
    std::int64_t count = 0;
    std::from_chars(text.data(), text.data() + text.size(), count);
    return count;
  }

  void reset() override {
    result_.reset();
    row_ = -1;
    std::ranges::fill(data_, nullptr);
  }

  int columns() const override { return PQnfields(result_.get()); }
  Type type(int column) const override {
    if (PQgetisnull(result_.get(), row_, column)) return Type::null;
    const unsigned oid = PQftype(result_.get(), column);
    if (oid == float8_oid) return Type::real;
    if (oid == bytea_oid) return Type::blob;
    const bool whole = oid == bool_oid || oid == int2_oid || oid == int4_oid || oid == int8_oid;
    return whole ? Type::integer : Type::text;
  }
  std::int64_t integer(int column) const override {
    if (type(column) == Type::real) return static_cast<std::int64_t>(real(column));
    if (type(column) != Type::integer) return 0;
    const std::string_view raw = bytes(column);
    const std::uint64_t bits = big_endian(raw.data(), raw.size());
    const auto unused = static_cast<unsigned>(64 - 8 * raw.size());
    return static_cast<std::int64_t>(bits << unused) >> unused;  // keeps the sign of a shorter one
  }
  double real(int column) const override {
    if (type(column) == Type::real) return std::bit_cast<double>(big_endian(bytes(column).data(), 8));
    return static_cast<double>(integer(column));
  }
  std::string_view bytes(int column) const override {
    return {PQgetvalue(result_.get(), row_, column),
            static_cast<std::size_t>(PQgetlength(result_.get(), row_, column))};
  }

 private:
  // `format`: 0: text, which ends with a zero byte, 1: binary.
  void put(int parameter, const char* data, int size = 0, int format = 0) {
    const auto k = static_cast<std::size_t>(parameter);
    data_.at(k) = data;
    sizes_[k] = size;
    formats_[k] = format;
  }

  template <class Number>
  void bind_number(int parameter, Number number) {
    auto& digits = digits_.at(static_cast<std::size_t>(parameter));
    *std::to_chars(digits.data(), digits.data() + digits.size() - 1, number).ptr = '\0';
    put(parameter, digits.data());
  }

  void prepare() {
    if (!kept_ || !name_.empty()) return;
    database_.finish_later();
    name_ = database_.prepare_as_name(sql_);
  }

  void run() {
    prepare();
    send();
    if (database_.has_sent()) {
      result_ = database_.read_sent();
      return;
    }
    result_ = database_.checked(PQgetResult(database_.handle()));
    while (PGresult* more = PQgetResult(database_.handle())) PQclear(more);
  }

  void send() {
    const int sent = kept_ ? PQsendQueryPrepared(database_.handle(), name_.c_str(), parameters_, data_.data(),
                                                 sizes_.data(), formats_.data(), 1)
                           : PQsendQueryParams(database_.handle(), sql_.c_str(), parameters_, nullptr,
                                               data_.data(), sizes_.data(), formats_.data(), 1);
    if (sent == 0) database_.raise(nullptr);
  }

  PostgresDatabase& database_;
  const bool kept_;
  int parameters_ = 0;
  std::string sql_, name_;
  // Of the parameters, as libpq takes them.
  std::vector<const char*> data_;
  std::vector<int> sizes_, formats_;
  std::vector<std::array<char, 32>> digits_;  // of numbers
  PostgresResult result_;
  int row_ = -1;
};

}  // namespace

void PostgresResultDeleter::operator()(pg_result* result) const {
  PQclear(result);
}

Result<void> check_postgres_url(const std::string& url) {
  char* why = nullptr;
  PQconninfoOption* options = PQconninfoParse(url.c_str(), &why);
  Result<void> sound;
  if (options == nullptr) sound = invalid("url", why != nullptr ? trimmed(why) : "cannot be read");
  PQconninfoFree(options);
  PQfreemem(why);
  return sound;
}

PostgresDatabase::PostgresDatabase(const std::string& url, const std::string& application_name) {
  // The URL's options take precedence, except for the name. A vanished peer is detected within half a minute.
  const std::array<const char*, 10> keywords = {"connect_timeout",
                                                "target_session_attrs",
                                                "tcp_user_timeout",
                                                "keepalives_idle",
                                                "keepalives_interval",
                                                "keepalives_count",
                                                "dbname",
                                                "application_name",
                                                "client_encoding",
                                                nullptr};
  const std::array<const char*, 10> values = {
      "5", "read-write", "15000", "10", "5", "3", url.c_str(), application_name.c_str(), "UTF8", nullptr};
  handle_ = PQconnectdbParams(keywords.data(), values.data(), 1);
  if (PQstatus(handle_) != CONNECTION_OK) {
    const std::string message = trimmed(PQerrorMessage(handle_));
    PQfinish(std::exchange(handle_, nullptr));
    throw SqlError(SqlError::Kind::unavailable, message);
  }
  PQsetNoticeProcessor(
      handle_, [](void*, const char*) {}, nullptr);
}

PostgresDatabase::~PostgresDatabase() {
  forget_statements();
  PQfinish(handle_);
}

void PostgresDatabase::raise(const pg_result* result) {
  const char* state = result ? PQresultErrorField(result, PG_DIAG_SQLSTATE) : nullptr;
  std::string message = trimmed(result ? PQresultErrorMessage(result) : PQerrorMessage(handle_));
  // An error without SQLSTATE is libpq's own: the server is lost. 57P: the server shuts down or was ordered
  // to end this connection, which it closes next.
  is_lost_ =
      is_lost_ || PQstatus(handle_) != CONNECTION_OK || !state || std::string_view(state).starts_with("57P");
  if (is_lost_)
    throw SqlError(SqlError::Kind::connection_lost,
                   message.empty() ? "the connection to PostgreSQL was lost" : message);
  throw SqlError(kind_of(state), message);
}

PostgresResult PostgresDatabase::checked(pg_result* result) {
  PostgresResult held(result);
  const ExecStatusType status = PQresultStatus(result);
  if (status != PGRES_COMMAND_OK && status != PGRES_TUPLES_OK) {
    // After a fatal error the server closes the connection, which libpq sees when it reads again.
    while (PGresult* more = PQgetResult(handle_)) PQclear(more);
    raise(result);
  }
  return held;
}

void PostgresDatabase::execute(const std::string& sql) {
  finish_later();
  (void)checked(PQexec(handle_, sql.c_str()));
}

void PostgresDatabase::limit_statements(std::chrono::milliseconds limit) {
  execute("SET lock_timeout = '1s'; SET statement_timeout = " + std::to_string(limit.count()));
}

std::unique_ptr<Statement> PostgresDatabase::prepare(std::string_view sql) {
  return std::make_unique<PostgresStatement>(*this, sql, false);
}

std::unique_ptr<Statement> PostgresDatabase::prepare_to_keep(std::string_view sql) {
  return std::make_unique<PostgresStatement>(*this, sql, true);
}

bool PostgresDatabase::has_table(std::string_view name) {
  Rows rows(statement("SELECT to_regclass(?) IS NOT NULL"));
  return rows.bind(name).next() && rows.boolean();
}

std::string PostgresDatabase::prepare_as_name(const std::string& sql) {
  const std::string name = "s" + std::to_string(++names_);
  (void)checked(PQprepare(handle_, name.c_str(), sql.c_str(), 0, nullptr));
  return name;
}

void PostgresDatabase::enter_pipeline() {
  if (sent_ == 0 && PQenterPipelineMode(handle_) == 0) raise(nullptr);
}

void PostgresDatabase::sent_later() {
  if (++sent_ >= max_sent) finish_later();
}

PostgresResult PostgresDatabase::read_sent() {
  sent_ = 0;
  if (PQpipelineSync(handle_) == 0) raise(nullptr);
  PostgresResult last, failed;
  for (int ends = 0;;) {  // a null result ends each statement's; two in a row: the connection is lost
    PostgresResult result(PQgetResult(handle_));
    if (!result) {
      if (++ends == 2) break;
      continue;
    }
    ends = 0;
    const ExecStatusType status = PQresultStatus(result.get());
    if (status == PGRES_PIPELINE_SYNC) break;
    if (status == PGRES_COMMAND_OK || status == PGRES_TUPLES_OK)
      last = std::move(result);
    else if (status != PGRES_PIPELINE_ABORTED && !failed)
      failed = std::move(result);
  }
  const bool left = PQexitPipelineMode(handle_) == 1;
  if (failed) raise(failed.get());
  if (!left || PQstatus(handle_) != CONNECTION_OK) raise(nullptr);
  return last;
}

bool PostgresDatabase::is_usable() const {
  return !is_lost_ && PQstatus(handle_) == CONNECTION_OK && PQpipelineStatus(handle_) == PQ_PIPELINE_OFF;
}

bool PostgresDatabase::in_transaction() const {
  return !is_lost_ && (sent_ > 0 || PQtransactionStatus(handle_) == PQTRANS_INTRANS ||
                       PQtransactionStatus(handle_) == PQTRANS_INERROR);
}

void PostgresDatabase::begin(Access access) {
  execute(access == Access::write ? "BEGIN" : "BEGIN ISOLATION LEVEL REPEATABLE READ READ ONLY");
}

void PostgresDatabase::commit() {
  finish_later();
  try {
    const PostgresResult result = checked(PQexec(handle_, "COMMIT"));
    if (std::strcmp(PQcmdStatus(result.get()), "COMMIT") != 0)
      throw SqlError(SqlError::Kind::internal, "the transaction was rolled back at COMMIT");
  } catch (const SqlError& error) {
    if (error.kind() != SqlError::Kind::connection_lost) throw;
    throw SqlError(SqlError::Kind::commit_unknown,
                   std::string("the connection was lost during COMMIT: ") + error.what());
  }
}

void PostgresDatabase::roll_back() {
  if (sent_ > 0) {
    try {
      finish_later();
    } catch (const SqlError&) {
      // Errors of statements that are rolled back do not matter.
    }
  }
  execute("ROLLBACK");
}

}  // namespace joulecast::history
