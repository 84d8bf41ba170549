/// The recording cannot grow any more; everything else does.

#include <gmock/gmock.h>
#include <sys/resource.h>

#include "spine.hpp"

namespace abbe::test {
namespace {

using testing::HasSubstr;

/// To the program it is the same as a full disk: pwrite() fails with EFBIG.
void limit_files_of(const Program& program, rlim_t bytes) {
  const rlimit limit{bytes, bytes};
  ASSERT_EQ(::prlimit(program.pid(), RLIMIT_FSIZE, &limit, nullptr), 0);
}

TEST_F(Spine, FullDiskEndsTheRecordingAndNothingElse) {
  write_path("path.csv", path());
  ASSERT_NO_FATAL_FAILURE(start_simulator());
  write_configuration();
  ASSERT_NO_FATAL_FAILURE(start_abbed());
  ASSERT_TRUE(eventually([this] { return samples("recorder") > 0; }));  // a chunk is in the file
  const auto size = std::filesystem::file_size(recordings().front());
  ASSERT_NO_FATAL_FAILURE(limit_files_of(*abbed_, size + 64 * 1024));

  ASSERT_TRUE(eventually([this] { return stream("recorder").value("state", "") == "disk full"; }));
  EXPECT_THAT(stream("recorder").value("last_fault", ""), HasSubstr("File too large"));
  EXPECT_TRUE(goes_on("encoder"));
  EXPECT_TRUE(goes_on("tracker"));
  EXPECT_EQ(abbed_->stop(), 0) << abbed_->err();

  const auto replayed = run({ABBE_PROGRAM, "replay", "--json", recordings().front()});
  EXPECT_EQ(replayed.code, 0) << replayed.err;
  const auto said = nlohmann::json::parse(replayed.out, nullptr, false);
  ASSERT_TRUE(said.is_object()) << replayed.out;
  EXPECT_GT(said["recorded_s"], 0.0);
  EXPECT_EQ(said["undecodable"], 0);
}

}  // namespace
}  // namespace abbe::test
