/// The list of exit codes that every --help prints.

#include "abbe/protocol/exit_codes.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <sstream>

namespace abbe::protocol {
namespace {

TEST(ExitCodes, PrintsTheSharedMeaningUnlessAProgramGivesItsOwn) {
  EXPECT_EQ(exit_codes_text({{ExitCode::Done, "stopped"}, {ExitCode::Usage}, {ExitCode::Internal}}),
            "Exit codes: 0 stopped; 2 usage; 70 internal error.");
}

TEST(ExitCodes, LinesHaveAtMost96Characters) {
  std::istringstream text(exit_codes_text({{ExitCode::Done},
                                           {ExitCode::DataInsufficient},
                                           {ExitCode::Usage},
                                           {ExitCode::BadInput},
                                           {ExitCode::Io},
                                           {ExitCode::Refused}}));
  std::size_t longest = 0;
  for (std::string line; std::getline(text, line);) longest = std::max(longest, line.size());
  EXPECT_LE(longest, 96u);
  EXPECT_GT(longest, 60u) << "the text is not wrapped at the width";
}

}  // namespace
}  // namespace abbe::protocol
