#pragma once
/// Formats samples as text, one line per sample, for people and for golden recordings: time in ms
/// since the beginning of the recording, names of the set flags, then the values. The same samples
/// give the same text.

#include <cstdio>

#include "abbe/pipeline/batch.hpp"

namespace abbe::daemon {

void print_samples(std::FILE* to, const Batch& batch, protocol::HostTime begin);

}  // namespace abbe::daemon
