#include "abbe/tasks/bar_passes_file.hpp"

#include <fmt/format.h>

#include <utility>

#include "abbe/base/text_file.hpp"
#include "abbe/base/units.hpp"
#include "abbe/result/try.hpp"

namespace abbe::daemon {
namespace {

namespace mfb = calib::mfb;

std::string_view feature_word(mfb::Feature feature) {
  switch (feature) {
    case mfb::Feature::Hole:
      return "hole";
    case mfb::Feature::Rod:
      return "rod";
    case mfb::Feature::Plane:
      return "plane";
  }
  return {};
}

}  // namespace

std::string rows_of(const mfb::Measurement& m, const mfb::PassTouches& touches) {
  std::string text;
  for (const mfb::Touch& touch : touches) {
    const bool plane = touch.target.feature == mfb::Feature::Plane;
    const std::string_view side = touch.target.side == mfb::Side::Left ? "L" : "R";
    const calib::Vector3 q_mm = kMmPerM * touch.reading_m;
    text += fmt::format("{},{},{},{},{},{:.17g},{:.17g},{:.17g}\n", m.name,
                        feature_word(touch.target.feature), touch.target.index + 1,
                        plane ? side : "", touch.target.k, q_mm.x(), q_mm.y(), q_mm.z());
  }
  return text;
}

std::string points_csv(std::string_view rows) {
  return fmt::format("measurement,feature,index,side,k,x_mm,y_mm,z_mm\n{}", rows);
}

BarPassesFile::BarPassesFile(std::filesystem::path file)
    : file_(std::move(file)), text_(points_csv("")) {}

Result<BarPassesFile> BarPassesFile::open(std::filesystem::path file, const mfb::Bar& bar,
                                          bool continues) {
  BarPassesFile passes(std::move(file));
  if (!std::filesystem::exists(passes.file_)) return passes;
  if (!continues)
    return fail(ErrorCode::Usage,
                fmt::format("{}: exists: --continue uses its passes; else remove it, or choose "
                            "another -o",
                            passes.file_.string()));
  auto text = read_regular_file(passes.file_);
  ABBE_TRY(text);
  passes.text_ = *std::move(text);
  ABBE_TRY(passes.count_rows(bar));
  return passes;
}

Result<void> BarPassesFile::add(const std::string& rows) {
  if (!text_.ends_with('\n')) text_ += '\n';
  text_ += rows;
  return replace_file(file_, text_);
}

Result<void> BarPassesFile::count_rows(const mfb::Bar& bar) {
  const std::string_view text = text_;
  constexpr auto kNone = std::string_view::npos;
  for (std::size_t begin = text.find('\n'); begin != kNone && begin + 1 < text.size();
       begin = text.find('\n', begin + 1)) {
    const std::string_view line = text.substr(begin + 1);
    ++rows_[std::string(line.substr(0, line.find(',')))];
  }

  const std::size_t whole = bar.pattern.count();
  for (const auto& [measurement, rows] : rows_)
    if (rows != whole)
      return fail(ErrorCode::BadInput,
                  fmt::format("{}: measurement \"{}\" has {} rows, a pass has {} touches: remove "
                              "its rows, then --continue touches it again",
                              file_.string(), measurement, rows, whole));
  return {};
}

}  // namespace abbe::daemon
