#pragma once

#include <nlohmann/json_fwd.hpp>
#include <stop_token>
#include <string>

#include "answers/matrix.h"
#include "describe/schema.h"

namespace joulecast::answers {

// "energy-matrix-request", "energy-matrix" and those to which they refer.
described::Schemas matrix_schemas();
// Errors name the field; too many cells are Fault::too_large.
Result<MatrixInput> read_matrix(const nlohmann::json& request);

// The answer, written piece by piece.
class MatrixText {
 public:
  explicit MatrixText(Matrix matrix) : matrix_(std::move(matrix)) {}

  // Appends the next piece; false after the last one, or when `left` is set. Works on two threads.
  bool next(std::string& out, const std::stop_token& left);

 private:
  Matrix matrix_;
  bool begun_ = false;
  std::size_t rows_done_ = 0;
};

}  // namespace joulecast::answers
