#pragma once
/// Converts the faults of a CSV file to an Error of the simulator, with one line per fault.

#include "abbe/protocol/table/faults.hpp"
#include "abbe/sim/error.hpp"

namespace abbe::sim {

/// Precondition: faults.any().
[[nodiscard]] inline Error table_error(const protocol::Faults& faults) {
  std::string text;
  for (const std::string& line : faults.lines()) text += (text.empty() ? "" : "\n") + line;
  return {ErrorCode::BadInput, text};
}

}  // namespace abbe::sim
