#pragma once
/// The faults of a CSV file as an Error of the simulator: one line each.

#include "abbe/protocol/table/faults.hpp"
#include "abbe/sim/error.hpp"

namespace abbe::sim {

/// Needs faults.any().
[[nodiscard]] inline Error table_error(const protocol::Faults& faults) {
  std::string text;
  for (const std::string& line : faults.lines()) text += (text.empty() ? "" : "\n") + line;
  return {ErrorCode::BadInput, text};
}

}  // namespace abbe::sim
