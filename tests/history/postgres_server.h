#pragma once

#include <string>

#include "temporary_store.h"

// The test program's own PostgreSQL server; see tests/support/postgresql.sh.
namespace joulecast::history {

// Of a schema that belongs to the folder, made when it is not there.
std::string postgres_url(const TemporaryFolder& folder);

// Runs a statement of an administrator, on a connection of its own; returns the first column of the first
// row.
std::string as_administrator(const TemporaryFolder& folder, const std::string& sql);

// The path of the server's socket.
std::string postgres_socket();

void start_postgres();
void stop_postgres();  // immediately, as after a power cut

}  // namespace joulecast::history
