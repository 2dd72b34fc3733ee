// A time series of VDB files: which frames there are and in which order.
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace isotrack {

struct InputFrame {
    int number = 0;    ///< From the file name's last digits; a file without digits takes its place in the list.
    std::string path;
};

struct FrameRange {
    int first, last;  ///< Both included.
    int step = 1;     ///< > 0
};

struct InputSequence {
    std::vector<InputFrame> frames;  ///< Ascending numbers, each once.
    std::vector<int> missing;        ///< Numbers between the first and the last (by the step) without a file.
};

/// Frames of `inputs`: files, folders (every .vdb in them), or patterns with `####`, `%04d` or `{}` for the number. `#` pads to at
/// least that many digits; `{}` and `%d` match any number of digits, `%04d` at least four. A plain list keeps natural order.
/// \throws OptionError when nothing matches, when two files have the same number, or for a pattern with two number fields.
InputSequence find_frames(const std::vector<std::string>& inputs, const std::optional<FrameRange>& range = {});

/// `A:B` or `A:B:STEP` or `A`, both ends included. \throws OptionError.
FrameRange parse_frame_range(const std::string& text);

/// Puts a frame number into a pattern; a pattern without a field is returned as it is.
std::string expand_pattern(const std::string& pattern, int frame);
bool has_frame_field(const std::string& pattern);

}  // namespace isotrack
