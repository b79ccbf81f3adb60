MODULE DloPickCable
  ! RAPID: take a picture, read the first cable's middle as a robtarget, go there.
  ! Bridge: [ascii] port = 4711, reply = "plain". Recipe 7: output unit mm, rotation abb.
  VAR socketdev bridge;
  VAR string line;
  VAR num field{16};
  CONST string EOL := "\0D\0A";

  PROC main()
    SocketCreate bridge;
    SocketConnect bridge, "192.168.0.20", 4711;
    Ask "T,200,7";
    IF field{2} <> 1 Stop;
    Ask "R,200,8000";
    IF field{2} = 0 AND field{3} >= 2 THEN
      Ask "G,200,2";
      MoveL Offs(Grasp(), 0, 0, 100), v200, fine, tGripper \WObj:=wobj0;
      MoveL Grasp(), v50, fine, tGripper \WObj:=wobj0;
    ENDIF
    Ask "X,200";
    SocketClose bridge;
  ENDPROC

  FUNC robtarget Grasp()
    VAR robtarget place;
    place := CRobT(\Tool:=tGripper \WObj:=wobj0);
    place.trans := [field{7}, field{8}, field{9}];
    place.rot := [field{10}, field{11}, field{12}, field{13}];
    RETURN place;
  ENDFUNC

  PROC Ask(string request)
    SocketSend bridge \Str:=request + EOL;
    SocketReceive bridge \Str:=line \Time:=10;
    Split;
  ENDPROC

  ! "R,200,0,3,7,1,412" to field{1} = 200, field{2} = 0, ...
  PROC Split()
    VAR num at := 1;
    VAR num comma;
    VAR num count := -1;
    VAR bool ok;
    WHILE at <= StrLen(line) DO
      comma := StrFind(line, at, ",\0D");
      count := count + 1;
      IF count >= 1 AND count <= 16 ok := StrToVal(StrPart(line, at, comma - at), field{count});
      at := comma + 1;
    ENDWHILE
  ENDPROC
ENDMODULE
