# Saves the waveform of the border as a picture, docs/border-waveform.png. From the root, with GTKWave
# and Xvfb, after `discreta simulate path examples/bulgaria.csv --method linear --vcd border.vcd`:
#   xvfb-run -a -s "-screen 0 1440x980x24" gtkwave -S docs/waveform.tcl border.vcd border.gtkw
gtkwave::setZoomRangeTimes 17080ns 17360ns
gtkwave::/File/Grab_To_File docs/border-waveform.png
gtkwave::/File/Quit
