#include "abbe/calib/sparse/folds.hpp"

#include <algorithm>
#include <charconv>
#include <numeric>
#include <random>

#include "abbe/calib/internal/base/message.hpp"

namespace abbe::calib::sparse {
namespace {

/// Fold of each row, in random order. Fisher-Yates shuffle, written out because std::shuffle gives
/// different results with different standard libraries.
std::vector<int> random_assignment(std::size_t rows, int folds, std::uint64_t seed) {
  std::vector<int> fold(rows);
  for (std::size_t i = 0; i < rows; ++i) {
    fold[i] = static_cast<int>(i % static_cast<std::size_t>(folds));
  }
  std::mt19937_64 random(seed);
  for (std::size_t i = rows; i > 1; --i) {
    std::swap(fold[i - 1], fold[random() % i]);
  }
  return fold;
}

std::vector<int> sorted_distinct(std::span<const int> labels) {
  std::vector<int> distinct(labels.begin(), labels.end());
  std::sort(distinct.begin(), distinct.end());
  distinct.erase(std::unique(distinct.begin(), distinct.end()), distinct.end());
  return distinct;
}

int rank_in(const std::vector<int>& sorted, int label) {
  return static_cast<int>(std::lower_bound(sorted.begin(), sorted.end(), label) - sorted.begin());
}

std::string_view trimmed(std::string_view line) {
  constexpr std::string_view kBlank = " \t\r";
  const std::size_t first = line.find_first_not_of(kBlank);
  if (first == std::string_view::npos) return {};
  return line.substr(first, line.find_last_not_of(kBlank) - first + 1);
}

bool parse_integer(std::string_view cell, int& number) {
  const auto [end, fault] = std::from_chars(cell.data(), cell.data() + cell.size(), number);
  return fault == std::errc{} && end == cell.data() + cell.size();
}

}  // namespace

Result<Folds> folds_from_labels(std::span<const int> label_of_row) {
  const std::vector<int> distinct = sorted_distinct(label_of_row);
  if (distinct.size() < 2) {
    return failure(ErrorCode::TooFewObservations,
                   message("folds from labels: ", distinct.size(), " label(s) on ",
                           label_of_row.size(), " rows"));
  }
  Folds folds{.of_row = {}, .count = static_cast<int>(distinct.size())};
  folds.of_row.reserve(label_of_row.size());
  for (const int label : label_of_row) {
    folds.of_row.push_back(rank_in(distinct, label));
  }
  return folds;
}

Result<Folds> parse_folds(std::string_view text) {
  std::vector<int> labels;
  for (std::size_t line_number = 1; !text.empty(); ++line_number) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    const std::string_view line = trimmed(text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
    int label = 0;
    if (line.empty()) continue;
    if (parse_integer(line, label)) {
      labels.push_back(label);
    } else if (line_number > 1) {
      return failure(ErrorCode::BadInput,
                     message("read folds: line ", line_number, " is not an integer: ", line));
    }
  }

  return folds_from_labels(labels);
}

Result<Folds> random_folds(std::size_t rows, int folds, std::uint64_t seed) {
  if (folds < 2 || rows < static_cast<std::size_t>(folds)) {
    return failure(ErrorCode::TooFewObservations,
                   message("split ", rows, " rows into ", folds,
                           " folds: needs at least 2 folds and as many rows as folds"));
  }
  return Folds{.of_row = random_assignment(rows, folds, seed), .count = folds};
}

}  // namespace abbe::calib::sparse
